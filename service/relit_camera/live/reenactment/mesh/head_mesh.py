"""The mesh of the whole moved head: the face, eyes whose lids hide the eyeball, and what lies beside the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.face.head_pose import HeadPose
from relit_camera.live.reenactment.dense_motion import box_around
from relit_camera.live.reenactment.mesh.eye_mesh import EyeMesh, eye_mesh
from relit_camera.live.reenactment.mesh.face_mesh import (
    MARGIN,
    OUTLINE_BLEND,
    FaceMesh,
    SurfacePatch,
    distance_from_sides,
    triangulate_face,
)
from relit_camera.live.reenactment.mesh.head_sides import CHEEK_SHARE, HeadSides, triangulate_sides
from relit_camera.live.reenactment.mesh.triangle_drawing import doubled_areas
from relit_camera.live.reenactment.source_image import SourceFace


@dataclass(frozen=True)
class HeadMesh:
    """The face of a source image with what belongs to it.

    Attributes:
        face: its landmarks.
        is_skin: (triangles of the face,) whether it does not span an eye's lids.
        eyes: right and left.
        sides: what lies beside the face; None where the source image's border cuts the head off.
        turned_trust: (members of the face,) how far the mesh counts where a side has turned away: up to the face's
            outline, but at the chin.
    """

    face: FaceMesh
    is_skin: NDArray[np.bool_]
    eyes: tuple[EyeMesh, EyeMesh]
    sides: HeadSides | None
    turned_trust: NDArray[np.float64]

    def with_shut_lids(self, landmarks: NDArray[np.float64]) -> NDArray[np.float64]:
        """Moved landmarks (count, 2), with lids that meet where they nearly do."""
        changed = landmarks.copy()
        for eye in self.eyes:
            eye.shut(changed)
        return changed

    def surface(self, landmarks: NDArray[np.float64], anchors: NDArray[np.float64], pose: HeadPose) -> SurfacePatch:
        """The mesh, moved.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels.
            anchors: (count, 2) where the anchors of head and shoulders go.
            pose: of the head that goes there.
        """
        face, target = self.face, landmarks[self.face.members]
        corners = target.take(face.triangles, axis=0)
        order = face.nearest_last(corners, pose)
        order = order[self.is_skin[order]]
        values = face.values.take(order, axis=0)
        eyes = [eye.eyeball(landmarks) for eye in self.eyes]
        drawn = [*(moved for moved, _ in eyes), corners.take(order, axis=0)]
        shown = [*(np.dstack([looks, np.ones(looks.shape[:2])]) for _, looks in eyes), values]
        reached = target
        if self.sides is not None:
            away = self.sides.turned_away(pose.rotation * face.face.pose.rotation.inv())
            count = len(face.members)
            more = away[:count] * (self.turned_trust - face.trust)
            values[..., 2] += more.take(face.triangles.take(order, axis=0))
            if away.any():
                beside = self.sides.corners(target, anchors, pose, face.face.size)
                facing = np.flatnonzero(doubled_areas(beside) * self.sides.clockwise > 0)
                trust = self.sides.trust.copy()
                trust[:count] = face.trust + more
                trust[count:] *= away[count:]
                triangles = self.sides.triangles.take(facing, axis=0)
                drawn.insert(0, beside.take(facing, axis=0))
                shown.insert(0, np.dstack([self.sides.places.take(facing, axis=0), trust.take(triangles)]))
            reached = np.vstack([target, anchors])
        return SurfacePatch(np.concatenate(drawn), np.concatenate(shown), box_around(reached, MARGIN * face.span))


def triangulate_head(face: SourceFace, anchors: NDArray[np.float64]) -> HeadMesh:
    """The mesh of a source image's head; `anchors` (count, 2) are those of head and shoulders there, or none."""
    mesh = triangulate_face(face)
    members, scheme = mesh.members, face.scheme
    right, left = (eye_mesh(face, eye) for eye in (scheme.right_eye, scheme.left_eye))
    spans_lids = np.any([np.isin(members[mesh.triangles], eye.lids).all(axis=1) for eye in (right, left)], axis=0)
    outline = face.head_points[members][mesh.outline]
    aside = np.abs(face.head_points[members, 0]).max()
    chin = ((np.abs(outline[..., 0]) < CHEEK_SHARE * aside) & (outline[..., 1] < 0)).any(axis=1)
    places = face.landmarks[members].astype(np.float64)
    turned_trust = smoothstep(distance_from_sides(places, places[mesh.outline[chin]]), 0, OUTLINE_BLEND * mesh.span)
    sides = triangulate_sides(face, members, anchors) if len(anchors) else None
    return HeadMesh(mesh, ~spans_lids, (right, left), sides, turned_trust)
