"""Flow over the face from a mesh of its landmarks, the nearest surface in front: a turned nose hides its far side.

The first-order mixture knows no surface: where one part of the face moves behind another it averages the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.landmarks.landmark_triangulation import delaunay_triangles, outline_edges
from relit_camera.live.reenactment.dense_motion import box_around
from relit_camera.live.reenactment.mesh.triangle_drawing import doubled_areas, draw_triangles
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import FlowPatch, Nodes, inverse_affine, patch_cover

MARGIN = 0.1
"""Eye distances round the face that the mesh's patch takes in: it fades out there and a little inside."""
OUTLINE_BLEND = 0.2
"""Eye distances inside the face's outline, over which the mesh's flow gives way to the flow around the face."""
FEATURE_REACH = 0.03
"""Eye distances round lids and lips: their own flow fades out between this and twice this distance. Where it reaches
further the rims of glasses waver, and the far cheek is dented below the eye."""
JUMP_CELLS = 8.0
"""Where neighboring cells look so many cells apart, an edge of the mesh lies between them."""


@dataclass(frozen=True)
class FaceMesh:
    """The landmarks of a source image's face, triangulated.

    Attributes:
        face: that face.
        members: (points,) the landmarks that are corners: all but the irises, which roll behind the lids.
        triangles: (count, 3) rows of `members`.
        clockwise: (count,) the sign of each triangle's area in the source image.
        middles: (count, 3) float64 head axes, cm: the middle of each triangle on the canonical face.
        outline: (sides, 2) rows of `members`: the sides of its outline.
        trust: (points,) float64 how far the mesh counts beside the flow round it: 0 at the outline, rising to 1 inside.
        values: (count, 3, 3) float64, of each triangle's corners: x and y in the source image, and the trust.
        span: the eye distance in source pixels.
    """

    face: SourceFace
    members: NDArray[np.intp]
    triangles: NDArray[np.intp]
    clockwise: NDArray[np.float64]
    middles: NDArray[np.float64]
    outline: NDArray[np.intp]
    trust: NDArray[np.float64]
    values: NDArray[np.float64]
    span: float

    def nearest_last(self, corners: NDArray[np.float64], pose: HeadPose) -> NDArray[np.intp]:
        """The triangles that face the camera, from the farthest to the nearest.

        Args:
            corners: (triangles, 3, 2) where the corners of all triangles go.
            pose: of the head that goes there.
        """
        facing = self.facing(corners)
        return np.asarray(facing[np.argsort(self.nearness(pose)[facing])])

    def facing(self, corners: NDArray[np.float64]) -> NDArray[np.intp]:
        """The triangles that face the camera where the corners of all go to `corners` (triangles, 3, 2)."""
        return np.flatnonzero(doubled_areas(corners) * self.clockwise > 0)

    def nearness(self, pose: HeadPose) -> NDArray[np.float64]:
        """Of the triangles of a head in this pose (count,): centimetres from its middle toward the camera."""
        return np.asarray(self.middles @ pose.rotation.as_matrix()[2])

    def surface(self, landmarks: NDArray[np.float64], pose: HeadPose) -> SurfacePatch:
        """The mesh, moved.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels.
            pose: of the head that goes there: it says which of two parts is nearer.
        """
        target = landmarks[self.members]
        corners = target.take(self.triangles, axis=0)
        order = self.nearest_last(corners, pose)
        return SurfacePatch(
            corners.take(order, axis=0), self.values.take(order, axis=0), box_around(target, MARGIN * self.span)
        )

    def feature_patch(self, flow: FlowPatch, feature: NDArray[np.float64], share: float) -> FeaturePatch:
        """The flow of an eye or the mouth, whose landmarks in the source image are `feature` (count, 2).

        It counts by a `share` beside the mesh.
        """
        return FeaturePatch(flow, box_around(feature, 0.0), FEATURE_REACH * self.span, share)


@dataclass(frozen=True)
class SurfacePatch:
    """The moved mesh: of surfaces behind each other the nearest shows.

    Attributes:
        corners: (triangles, 3, 2) float64 source pixels where the corners go, from the farthest to the nearest.
        values: (triangles, 3, 3) float64 as in `FaceMesh`, of the corners.
        box: (4,) float64 round them all, toward whose sides the patch fades out.
        soft_edges: 0..1, how far edges between near and far are averaged, but the outline of the face: else they are
            staircases of cells.
        beside: how many of the triangles, the first, lie beside the face.
    """

    corners: NDArray[np.float64]
    values: NDArray[np.float64]
    box: NDArray[np.float64]
    soft_edges: float = 0.0
    beside: int = 0

    def write(self, nodes: Nodes) -> None:
        """See `Patch.write`."""
        part = nodes.within(self.box)
        if part is None:
            return
        inverse = inverse_affine(part.source_from_node)
        corners = self.corners @ inverse[:, :2].T + inverse[:, 2]
        values = self.values
        if self.soft_edges > 0:
            is_face = np.broadcast_to((np.arange(len(values)) >= self.beside)[:, None, None], (*values.shape[:2], 1))
            values = np.concatenate([values, is_face], axis=2)
        x, y, trust, *face = draw_triangles(corners, values, part.positions.shape[1:])
        if self.soft_edges > 0:
            jump = JUMP_CELLS * abs(float(part.source_from_node[0, 0]))
            _soften((x, y, trust), face[0] > 0, jump, self.soft_edges)
        part.blend(x, y, trust * patch_cover(part, self.box))


@dataclass(frozen=True)
class FeaturePatch:
    """The flow of an eye or the mouth, but where the mesh shows something else there: a nose before the far eye.

    Attributes:
        flow: its fine flow.
        feature: (4,) float64 box of it in the source image.
        reach: source pixels beside that box, from which on and up to twice of which its flow gives way.
        share: by which it counts.
    """

    flow: FlowPatch
    feature: NDArray[np.float64]
    reach: float
    share: float

    def write(self, nodes: Nodes) -> None:
        """See `Patch.write`."""
        part = nodes.within(self.flow.box) if self.share > 0 else None
        if part is None:
            return
        left, top, right, bottom = self.feature.astype(np.float32)
        x, y = part.positions
        beside = np.maximum(np.maximum(left - x, x - right), np.maximum(top - y, y - bottom))
        shown = np.clip(2 - beside / np.float32(self.reach), 0, 1) * np.float32(self.share)
        part.blend(*self.flow.positions(part), shown * patch_cover(part, self.flow.box))


def _soften(
    drawn: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]],
    face: NDArray[np.bool_],
    jump: float,
    share: float,
) -> None:
    """Average what a mesh draws (x, y, trust, each (rows, columns)), in place, over 3 × 3 cells where x jumps.

    Only where all nine are the face, or none: its outline is drawn pixel by pixel. Only a side that turns away has such
    edges, so they are upright. The average counts by a `share` 0..1.
    """
    kernel, x = np.ones((3, 3), np.uint8), drawn[0]
    jumps = np.zeros(x.shape, np.uint8)
    jumps[:, 1:] = np.abs(np.diff(x, axis=1)) > jump
    within, beside = (cv2.erode(each.view(np.uint8), kernel, borderValue=0) for each in (face, (x != 0) & ~face))
    known = within | beside
    places = np.flatnonzero(cv2.bitwise_and(cv2.dilate(jumps, kernel), known))
    for channel in drawn if places.size else ():
        flat = channel.reshape(-1)
        soft = cv2.blur(channel, (3, 3)).reshape(-1).take(places)
        flat[places] += np.float32(share) * (soft - flat[places])


def triangulate_face(face: SourceFace, blend: float = OUTLINE_BLEND) -> FaceMesh:
    """The mesh of a source image's face; over `blend` eye distances inside its outline it gives way to other flow."""
    irises = {*face.scheme.right_eye.iris, *face.scheme.left_eye.iris}
    members = np.array([index for index in range(face.scheme.count) if index not in irises], dtype=np.intp)
    corners = face.landmarks[members].astype(np.float64)
    triangles = delaunay_triangles(face.landmarks[members])
    outline = outline_edges(triangles)
    span = face.scheme.eye_span(face.landmarks)
    trust = smoothstep(distance_from_sides(corners, corners[outline]), 0, blend * span)
    return FaceMesh(
        face=face,
        members=members,
        triangles=triangles,
        clockwise=np.sign(doubled_areas(corners[triangles])),
        middles=face.scheme.canonical[members][triangles].mean(axis=1),
        outline=outline,
        trust=trust,
        values=np.column_stack([corners, trust])[triangles],
        span=span,
    )


def distance_from_sides(points: NDArray[np.float64], sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of points (count, 2) from the nearest of line segments (some, 2, 2): (count,)."""
    start, along = sides[:, 0], sides[:, 1] - sides[:, 0]
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1, initial=np.inf))
