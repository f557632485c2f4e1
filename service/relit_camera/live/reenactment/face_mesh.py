"""Flow over the face from a mesh of its landmarks, the nearest surface in front: a turned nose hides its far side.

The first-order mixture knows no surface: where one part of the face moves behind another it averages the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.landmarks.landmark_triangulation import delaunay_triangles, outline_edges
from relit_camera.live.reenactment.dense_motion import box_around
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import FlowPatch, Nodes, inverse_affine, patch_cover

MARGIN = 0.1
"""Eye distances round the face that the mesh's patch takes in: it fades out there and a little inside."""
OUTLINE_BLEND = 0.2
"""Eye distances inside the face's outline, over which the mesh's flow gives way to the flow around the face."""
FEATURE_REACH = 0.1
"""Eye distances round lids and lips: their own flow fades out between this and twice this distance."""
ON_BORDER = 1e-5
"""Share of a triangle by which a point beyond it still counts as on its border, so that rounding opens no seam."""


@dataclass(frozen=True)
class FaceMesh:
    """The landmarks of a source image's face, triangulated.

    Attributes:
        face: that face.
        members: (points,) the landmarks that are corners: all but the irises, which roll behind the lids.
        triangles: (count, 3) rows of `members`.
        clockwise: (count,) the sign of each triangle's area in the source image.
        middles: (count, 3) float64 head axes, cm: the middle of each triangle on the canonical face.
        values: (count, 3, 3) float64, of each triangle's corners: x and y in the source image, and how far the mesh
            counts beside the flow round it, 0 at the outline of the face, rising to 1 inside.
        span: the eye distance in source pixels.
    """

    face: SourceFace
    members: NDArray[np.intp]
    triangles: NDArray[np.intp]
    clockwise: NDArray[np.float64]
    middles: NDArray[np.float64]
    values: NDArray[np.float64]
    span: float

    def surface(self, landmarks: NDArray[np.float64], pose: HeadPose) -> SurfacePatch:
        """The mesh, moved.

        Args:
            landmarks: (count, 2) where all landmarks go, source pixels.
            pose: of the head that goes there: it says which of two parts is nearer.
        """
        target = landmarks[self.members]
        corners = target.take(self.triangles, axis=0)
        facing = np.flatnonzero(doubled_areas(corners) * self.clockwise > 0)
        nearness = self.middles @ pose.rotation.as_matrix()[2]
        order = facing[np.argsort(nearness[facing])]
        return SurfacePatch(
            corners.take(order, axis=0), self.values.take(order, axis=0), box_around(target, MARGIN * self.span)
        )

    def feature_patch(self, flow: FlowPatch, feature: NDArray[np.float64]) -> FeaturePatch:
        """The flow of an eye or the mouth, whose landmarks in the source image are `feature` (count, 2)."""
        return FeaturePatch(flow, box_around(feature, 0.0), FEATURE_REACH * self.span)


@dataclass(frozen=True)
class SurfacePatch:
    """The moved mesh: of surfaces behind each other the nearest shows.

    Attributes:
        corners: (triangles, 3, 2) float64 source pixels where the corners go, from the farthest to the nearest.
        values: (triangles, 3, 3) float64 as in `FaceMesh`, of the corners.
        box: (4,) float64 round them all, toward whose sides the patch fades out.
    """

    corners: NDArray[np.float64]
    values: NDArray[np.float64]
    box: NDArray[np.float64]

    def write(self, nodes: Nodes) -> None:
        """See `Patch.write`."""
        part = nodes.within(self.box)
        if part is None:
            return
        inverse = inverse_affine(part.source_from_node)
        corners = self.corners @ inverse[:, :2].T + inverse[:, 2]
        x, y, trust = draw_triangles(corners, self.values, part.positions.shape[1:])
        part.blend(x, y, trust * patch_cover(part, self.box))


@dataclass(frozen=True)
class FeaturePatch:
    """The flow of an eye or the mouth, but where the mesh shows something else there: a nose before the far eye.

    Attributes:
        flow: its fine flow.
        feature: (4,) float64 box of it in the source image.
        reach: source pixels beside that box, from which on and up to twice of which its flow gives way.
    """

    flow: FlowPatch
    feature: NDArray[np.float64]
    reach: float

    def write(self, nodes: Nodes) -> None:
        """See `Patch.write`."""
        part = nodes.within(self.flow.box)
        if part is None:
            return
        left, top, right, bottom = self.feature.astype(np.float32)
        x, y = part.positions
        beside = np.maximum(np.maximum(left - x, x - right), np.maximum(top - y, y - bottom))
        shown = np.clip(2 - beside / np.float32(self.reach), 0, 1)
        part.blend(*self.flow.positions(part), shown * patch_cover(part, self.flow.box))


def draw_triangles(
    corners: NDArray[np.float64], values: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float32]:
    """Triangles drawn over each other in their order, with values interpolated between corners, 0 where there is none.

    A point shows the last triangle that it lies in; pixel (row, column) stands for the point (column, row).

    Args:
        corners: (triangles, 3, 2) columns and rows.
        values: (triangles, 3, channels).
        shape: (rows, columns) of the picture to draw.

    Returns:
        (channels, rows, columns) float32.
    """
    rows, columns = shape
    (x, y), (ax, ay), (bx, by) = np.ascontiguousarray(corners.transpose(1, 2, 0))
    first_row = np.maximum(np.ceil(np.minimum(np.minimum(y, ay), by)), 0)
    last_row = np.minimum(np.floor(np.maximum(np.maximum(y, ay), by)), rows - 1)
    ax, ay, bx, by = ax - x, ay - y, bx - x, by - y
    area = ax * by - ay * bx
    flat = area == 0  # such a triangle shows nowhere
    area[flat] = 1
    # The corners' weights, and what is interpolated by them, are planes over the picture: the change a column, the
    # change a row, and the value at column 0 of row 0; (3 of these, corners or channels, triangles).
    weights = np.empty((3, 3, len(corners)))
    weights[:2, 1] = by / area, -bx / area
    weights[:2, 2] = -ay / area, ax / area
    weights[2, 1:] = -(weights[0, 1:] * x + weights[1, 1:] * y)
    weights[:, 0] = -(weights[:, 1] + weights[:, 2])
    weights[2, 0] += 1
    base, *others = values.transpose(1, 2, 0)
    planes = sum(weights[:, None, i] * (other - base) for i, other in enumerate(others, 1))
    planes[2] += base
    lines = np.maximum(last_row - first_row + 1, 0)
    lines[flat] = 0
    lines = lines.astype(np.intp)
    # In each line of nodes a triangle shows from where the last of its weights gets positive to where the first ends.
    triangle = np.repeat(np.arange(len(lines)), lines)
    line = np.arange(len(triangle)) + (first_row - (np.cumsum(lines) - lines)).take(triangle)
    slope, down, start = weights
    slope[slope == 0] = np.finfo(np.float64).tiny ** 0.5
    ends = np.concatenate([(-ON_BORDER - start) / slope, down / slope]).take(triangle, axis=1)
    end = ends[:3] - ends[3:] * line
    rising = (slope > 0).take(triangle, axis=1)
    left = np.ceil(np.where(rising, end, 0).max(axis=0).clip(0, columns))
    right = np.floor(np.where(rising, columns - 1, end).min(axis=0).clip(-1, columns - 1))
    count = np.maximum(right - left + 1, 0).astype(np.intp)
    across, downward, origin = planes.take(triangle, axis=2)
    begin = origin + across * left + downward * line
    span = np.repeat(np.arange(len(count)), count)
    along = np.arange(len(span)) - (np.cumsum(count) - count).take(span)
    place = (line * columns + left).astype(np.intp).take(span) + along
    shown = across.astype(np.float32).take(span, axis=1)
    shown *= along.astype(np.float32)
    shown += begin.astype(np.float32).take(span, axis=1)
    drawn = np.zeros((len(planes[0]), rows * columns), np.float32)
    for channel, value in zip(drawn, shown, strict=True):
        channel[place] = value  # where a place is given several times the last value stays
    return drawn.reshape(-1, rows, columns)


def triangulate_face(face: SourceFace) -> FaceMesh:
    """The mesh of a source image's face."""
    irises = {*face.scheme.right_eye.iris, *face.scheme.left_eye.iris}
    members = np.array([index for index in range(face.scheme.count) if index not in irises], dtype=np.intp)
    corners = face.landmarks[members].astype(np.float64)
    triangles = delaunay_triangles(face.landmarks[members])
    outline = corners[outline_edges(triangles)]
    span = face.scheme.eye_span(face.landmarks)
    trust = smoothstep(_distance(corners, outline), 0, OUTLINE_BLEND * span)
    clockwise = np.sign(doubled_areas(corners[triangles]))
    middles = face.scheme.canonical[members][triangles].mean(axis=1)
    return FaceMesh(face, members, triangles, clockwise, middles, np.column_stack([corners, trust])[triangles], span)


def doubled_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas (count,) of triangles (count, 3, 2), doubled."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.asarray(ax * by - ay * bx)


def _distance(points: NDArray[np.float64], sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of points (count, 2) from the nearest of line segments (some, 2, 2): (count,)."""
    start, along = sides[:, 0], sides[:, 1] - sides[:, 0]
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1))
