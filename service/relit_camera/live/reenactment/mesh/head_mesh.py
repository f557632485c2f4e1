"""The mesh of the whole moved head: the face, eyes whose lids hide the eyeball, and what lies beside the face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.landmarks.landmark_triangulation import outline_edges
from relit_camera.live.reenactment.control_points import BEYOND_HAIR
from relit_camera.live.reenactment.dense_motion import box_around
from relit_camera.live.reenactment.mesh.eye_mesh import EyeMesh, eye_mesh
from relit_camera.live.reenactment.mesh.face_mesh import (
    MARGIN,
    FaceMesh,
    SurfacePatch,
    distance_from_sides,
    triangulate_face,
)
from relit_camera.live.reenactment.mesh.far_outline import Silhouette
from relit_camera.live.reenactment.mesh.head_sides import (
    HeadSides,
    above_neck,
    ear_in_sight,
    on_cheek,
    triangulate_sides,
)
from relit_camera.live.reenactment.source_image import SourceFace

SHOWN_BLEND = 0.07
"""As `OUTLINE_BLEND`, which mode live has for light alone, where the source image itself is shown. Over more, what
mesh and flow show lies beside each other, as stripes along a turned cheek; over less the face seems to be cut out."""
TURNED_MARGIN = 0.35
"""Eye distances round face and hair that the mesh of a turned head takes in: it fades out there, not over the ear."""
HIDDEN_CM = ((-5.0, -2.0), (6.5, 3.5))
"""Y in head axes, upward from the jaw and downward from the temple: from where on the far cheek hides an ear, and from
where on wholly. Below them the neck is in sight, above them hair."""
EAR_IN_SIGHT_CM = (0.9, 0.2)
"""`ear_in_sight` from which on it is left out, for there is no more than a line of it, and from which on wholly."""


@dataclass(frozen=True)
class HeadMesh:
    """The face of a source image with what belongs to it.

    Attributes:
        face: its landmarks.
        eyes: right and left.
        within, around: (2, triangles of the face) whether each lies between the lids of the right and of the left eye,
            and whether it is skin that touches them.
        sides: what lies beside the face; None where the source image's border cuts the head off.
        turned_trust: (members of the face,) how far the mesh counts where a side has turned away: up to the face's
            outline, but at chin and jaw.
    """

    face: FaceMesh
    eyes: tuple[EyeMesh, EyeMesh]
    within: NDArray[np.bool_]
    around: NDArray[np.bool_]
    sides: HeadSides | None
    turned_trust: NDArray[np.float64]

    def with_lids_that_meet(
        self, landmarks: NDArray[np.float64], pose: HeadPose
    ) -> tuple[NDArray[np.float64], tuple[float, float]]:
        """Moved landmarks, with lids that meet where they nearly do.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels; they stay as they are.
            pose: of the head that goes there.

        Returns:
            The landmarks (count, 2), and the closing of the right and of the left eye, see `EyeMesh.meet_lids`.
        """
        changed = landmarks.copy()
        right, left = (eye.meet_lids(changed, pose) for eye in self.eyes)
        return changed, (right, left)

    def silhouette(
        self, landmarks: NDArray[np.float64], pose: HeadPose, to_picture: NDArray[np.float64]
    ) -> Silhouette | None:
        """The outline of the side that has turned away; None where none has.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels.
            pose: of the head that goes there.
            to_picture: (2, 3) source pixels → pixels of the moved picture.
        """
        face, turn = self.face, pose.rotation * self.face.face.pose.rotation.inv()
        away = None if self.sides is None else self.sides.turned_away(turn)[: len(face.members)]
        if away is None or not away.any():
            return None
        points = landmarks[face.members] @ to_picture[:, :2].T + to_picture[:, 2]
        triangles = face.triangles[face.facing(points.take(face.triangles, axis=0))]
        edges = outline_edges(triangles)
        places = face.face.head_points[face.members]
        shares = (away * self.turned_trust)[edges].mean(axis=1)
        edges, shares = edges[shares > 0], shares[shares > 0]
        if not len(edges):
            return None
        height = places[edges, 1].mean(axis=1)
        hiding = smoothstep(height, *HIDDEN_CM[0]) * smoothstep(height, *HIDDEN_CM[1])
        hiding *= smoothstep(ear_in_sight(pose, angles_from_rotation(turn).yaw), *EAR_IN_SIGHT_CM)
        return Silhouette(points[triangles], points[edges], shares, hiding)

    def surface(
        self,
        landmarks: NDArray[np.float64],
        anchors: NDArray[np.float64],
        pose: HeadPose,
        closing: tuple[float, float],
    ) -> SurfacePatch:
        """The mesh, moved.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels.
            anchors: (count, 2) where the anchors of head and shoulders go.
            pose: of the head that goes there.
            closing: of the eyes.
        """
        face, target = self.face, landmarks[self.face.members]
        away = None if self.sides is None else self.sides.turned_away(pose.rotation * face.face.pose.rotation.inv())
        corners = target.take(face.triangles, axis=0)
        order = face.nearest_last(corners, pose)
        values, turned = face.values, 0.0 if away is None else float(away.max())
        if away is not None and turned > 0:
            trust = face.trust + away[: len(face.trust)] * (self.turned_trust - face.trust)
            values = np.dstack([values[..., :2], trust.take(face.triangles)])
        drawn, shown = self._with_eyeballs(corners, values, order, landmarks, pose, closing)
        of_face, box = len(drawn), box_around(target, MARGIN * face.span)
        if self.sides is not None and away is not None and turned > 0:
            beside, looks, vertices = self.sides.facing(target, anchors, pose, face.face.size)
            # Nothing beside the face counts before its side turns, not even where the outline is hollow.
            trusts = away * np.concatenate([self.turned_trust, self.sides.trust])
            drawn = np.concatenate([beside, drawn])
            shown = np.concatenate([np.dstack([looks, trusts.take(vertices)]), shown])
            # It grows as the side turns: at once, the patch's rim would be seen to jump.
            whole = box_around(np.vstack([target, anchors[BEYOND_HAIR]]), TURNED_MARGIN * face.span)
            box = box + turned * (whole - box)
        return SurfacePatch(drawn, shown, box, turned, len(drawn) - of_face)

    def _with_eyeballs(
        self,
        corners: NDArray[np.float64],
        values: NDArray[np.float64],
        order: NDArray[np.intp],
        landmarks: NDArray[np.float64],
        pose: HeadPose,
        closing: tuple[float, float],
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Corners and values of the face's triangles in their order, and behind the skin round it each eyeball."""
        closed = [index for index, share in enumerate(closing) if share > 0]
        if not closed:
            return corners.take(order, axis=0), values.take(order, axis=0)
        order = order[~np.asarray(self.within[closed].any(axis=0), np.bool_)[order]]
        nearness = self.face.nearness(pose)[order]
        drawn, shown, near = [corners.take(order, axis=0)], [values.take(order, axis=0)], [nearness]
        for index in closed:
            moved, looks = self.eyes[index].eyeball(landmarks)
            skin = nearness[self.around[index][order]]
            drawn.append(moved)
            shown.append(np.dstack([looks, np.ones(looks.shape[:2])]))
            near.append(np.full(len(moved), np.nextafter(skin.min(initial=np.inf), -np.inf)))
        back_to_front = np.argsort(np.concatenate(near), kind="stable")
        return np.concatenate(drawn)[back_to_front], np.concatenate(shown)[back_to_front]


def triangulate_head(face: SourceFace, anchors: NDArray[np.float64]) -> HeadMesh:
    """The mesh of a source image's head; `anchors` (count, 2) are those of head and shoulders there, or none."""
    mesh = triangulate_face(face, SHOWN_BLEND)
    members, scheme = mesh.members, face.scheme
    right, left = (eye_mesh(face, eye) for eye in (scheme.right_eye, scheme.left_eye))
    on_lids = np.stack([np.isin(members[mesh.triangles], eye.lids) for eye in (right, left)])
    within, touching = np.asarray(on_lids.all(axis=2), np.bool_), np.asarray(on_lids.any(axis=2), np.bool_)
    outline = face.head_points[members][mesh.outline]
    chin = (~on_cheek(outline) & (outline[..., 1] < 0)).any(axis=1)
    places = face.landmarks[members].astype(np.float64)
    to_outline = smoothstep(distance_from_sides(places, places[mesh.outline[chin]]), 0, SHOWN_BLEND * mesh.span)
    turned_trust = mesh.trust + above_neck(face.head_points[members]) * (to_outline - mesh.trust)
    sides = triangulate_sides(face, members, anchors) if len(anchors) else None
    return HeadMesh(mesh, (right, left), within, touching & ~within, sides, turned_trust)
