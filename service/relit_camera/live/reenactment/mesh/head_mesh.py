"""The mesh of the whole moved head: the face, eyes whose lids hide the eyeball, and what lies beside the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.face.head_pose import HeadPose
from relit_camera.live.reenactment.control_points import BEYOND_HAIR
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
from relit_camera.live.reenactment.source_image import SourceFace

TURNED_MARGIN = 0.35
"""Eye distances round face and hair that the mesh of a turned head takes in: it fades out there, not over the ear."""


@dataclass(frozen=True)
class HeadMesh:
    """The face of a source image with what belongs to it.

    Attributes:
        face: its landmarks.
        eyes: right and left.
        within: (2, triangles of the face) whether each lies between the lids of the right and of the left eye.
        sides: what lies beside the face; None where the source image's border cuts the head off.
        turned_trust: (members of the face,) how far the mesh counts where a side has turned away: up to the face's
            outline, but at the chin.
    """

    face: FaceMesh
    eyes: tuple[EyeMesh, EyeMesh]
    within: NDArray[np.bool_]
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
        closing = [index for index, eye in enumerate(self.eyes) if eye.closing(landmarks) > 0]
        hidden = np.asarray(self.within[closing].any(axis=0), np.bool_)
        order = order[~hidden[order]]
        values = face.values.take(order, axis=0)
        drawn, shown = [corners.take(order, axis=0)], [values]
        for index in closing:
            moved, looks = self.eyes[index].eyeball(landmarks)
            drawn.insert(0, moved)
            shown.insert(0, np.dstack([looks, np.ones(looks.shape[:2])]))
        sides, reached = self._sides_turned_away(pose), target
        if sides is not None:
            mesh, away = sides
            count, reached = len(target), np.vstack([target, anchors[BEYOND_HAIR]])
            trust = away * mesh.trust
            trust[:count] = face.trust + away[:count] * (self.turned_trust - face.trust)
            values[..., 2] = trust.take(face.triangles.take(order, axis=0))
            beside, looks, vertices = mesh.facing(target, anchors, pose, face.face.size)
            drawn.insert(0, beside)
            shown.insert(0, np.dstack([looks, trust.take(vertices)]))
        margin = MARGIN if sides is None else TURNED_MARGIN
        box = box_around(reached, margin * face.span)
        return SurfacePatch(np.concatenate(drawn), np.concatenate(shown), box, soft_edges=sides is not None)

    def _sides_turned_away(self, pose: HeadPose) -> tuple[HeadSides, NDArray[np.float64]] | None:
        """The sides and how far each of their points has turned away; None where nothing has."""
        if self.sides is None:
            return None
        away = self.sides.turned_away(pose.rotation * self.face.face.pose.rotation.inv())
        return (self.sides, away) if away.any() else None


def triangulate_head(face: SourceFace, anchors: NDArray[np.float64]) -> HeadMesh:
    """The mesh of a source image's head; `anchors` (count, 2) are those of head and shoulders there, or none."""
    mesh = triangulate_face(face)
    members, scheme = mesh.members, face.scheme
    right, left = (eye_mesh(face, eye) for eye in (scheme.right_eye, scheme.left_eye))
    within = np.stack([np.isin(members[mesh.triangles], eye.lids).all(axis=1) for eye in (right, left)])
    outline = face.head_points[members][mesh.outline]
    aside = np.abs(face.head_points[members, 0]).max()
    chin = ((np.abs(outline[..., 0]) < CHEEK_SHARE * aside) & (outline[..., 1] < 0)).any(axis=1)
    places = face.landmarks[members].astype(np.float64)
    turned_trust = smoothstep(distance_from_sides(places, places[mesh.outline[chin]]), 0, OUTLINE_BLEND * mesh.span)
    sides = triangulate_sides(face, members, anchors) if len(anchors) else None
    return HeadMesh(mesh, (right, left), within, sides, turned_trust)
