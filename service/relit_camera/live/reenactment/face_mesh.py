"""Flow over the face from a mesh of its landmarks, the nearest surface in front: a turned nose hides its far side.

The first-order mixture knows no surface: where one part of the face moves behind another it averages the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from relit_camera.base.easing import smoothstep
from relit_camera.face.head_pose import HeadPose
from relit_camera.live.reenactment.dense_motion import Region, region_around
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import FlowPatch

GRID_SHAPE = (160, 160)
"""Rows and columns over the face: the ridge of a nose is some ten of them wide."""
MARGIN = 0.1
"""Eye distances round the face that the grid takes in."""
OUTLINE_BLEND = 0.2
"""Eye distances inside the face's outline, over which the mesh's flow gives way to the flow around the face."""
FEATURE_REACH = 0.1
"""Eye distances round lids and lips: their own flow fades out between this and twice this distance."""
EXTRAPOLATION_LIMIT = 0.25
"""Share of a triangle by which points outside may look beyond its own part of the source image."""
SUBPIXEL_BITS = 4


@dataclass(frozen=True)
class FaceMesh:
    """The landmarks of a source image's face, triangulated.

    Attributes:
        face: that face.
        members: (points,) the landmarks that are corners: all but the irises, which roll behind the lids.
        triangles: (count, 3) rows of `members`.
        clockwise: (count,) the sign of each triangle's area in the source image.
        trust: (points,) 0 at the outline of them all, rising to 1 inside: how far the mesh counts beside the flow
            round it.
    """

    face: SourceFace
    members: NDArray[np.intp]
    triangles: NDArray[np.intp]
    clockwise: NDArray[np.float64]
    trust: NDArray[np.float64]

    def surface_flow(self, head: FlowPatch, landmarks: NDArray[np.float64], pose: HeadPose) -> FlowPatch:
        """The flow of the mesh over the face, and `head`'s where the mesh does not reach.

        Args:
            head: the flow of the whole head.
            landmarks: (count, 2) where all landmarks go, source pixels.
            pose: of the head that goes there: it says which of two parts is nearer.
        """
        target, source = landmarks[self.members], self.face.landmarks[self.members].astype(np.float64)
        span = self.face.scheme.eye_span(self.face.landmarks)
        region = region_around(target, MARGIN * span, *GRID_SHAPE)
        step = (region.box[2:] - region.box[:2]) / [region.columns - 1, region.rows - 1]
        depth = (self.face.scheme.canonical[self.members] @ pose.rotation.as_matrix().T)[:, 2]
        shown = self._nearest((target - region.box[:2]) / step, depth)
        covered = shown >= 0
        grid = region.grid.reshape(region.rows, region.columns, 2)
        flow = _resampled(head, grid)
        triangles = self.triangles[shown[covered]]
        weights = _barycentric(grid[covered], target[triangles])
        trust = np.einsum("nk,nk->n", weights, self.trust[triangles])[:, None]
        source_positions = np.einsum("nk,nki->ni", weights, source[triangles])
        flow[covered] += trust * (source_positions - grid[covered] - flow[covered])
        return FlowPatch(flow, region.box)

    def occlude_feature(self, patch: FlowPatch, mesh: FlowPatch, feature: NDArray[np.float64]) -> FlowPatch:
        """A fine patch, but where the mesh shows something else in front of it: a nose before the far eye.

        Args:
            patch: the flow of an eye or the mouth.
            mesh: what `surface_flow` has given.
            feature: (count, 2) its landmarks in the source image.
        """
        rows, columns = patch.flow.shape[:2]
        grid = Region(patch.region, rows, columns).grid.reshape(rows, columns, 2)
        flow = _resampled(mesh, grid)
        reach = FEATURE_REACH * self.face.scheme.eye_span(self.face.landmarks)
        beside = np.maximum(feature.min(axis=0) - (grid + flow), (grid + flow) - feature.max(axis=0)).max(axis=2)
        share = np.clip(beside / reach - 1, 0, 1)[..., None].astype(np.float32)
        return FlowPatch(patch.flow + share * (flow - patch.flow), patch.region)

    def _nearest(self, corners: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.int32]:
        """The triangle that shows at each grid point, −1 where none does: (rows, columns).

        Args:
            corners: (points, 2) in grid points.
            depth: (points,) the nearer, the greater.
        """
        shown = np.full(GRID_SHAPE, -1, np.int32)
        facing = _doubled_areas(corners[self.triangles]) * self.clockwise > 0
        order = np.argsort(depth[self.triangles].mean(axis=1))
        fixed = np.round(corners[self.triangles] * (1 << SUBPIXEL_BITS)).astype(np.int32)
        for index in order[facing[order]]:
            cv2.fillConvexPoly(shown, fixed[index], int(index), shift=SUBPIXEL_BITS)
        return shown


def triangulate_face(face: SourceFace) -> FaceMesh:
    """The mesh of a source image's face."""
    irises = {*face.scheme.right_eye.iris, *face.scheme.left_eye.iris}
    members = np.array([index for index in range(face.scheme.count) if index not in irises], dtype=np.intp)
    corners = face.landmarks[members].astype(np.float64)
    delaunay = Delaunay(corners)
    triangles = np.asarray(delaunay.simplices, dtype=np.intp)
    outline = np.array([corners[row] for row in delaunay.convex_hull])
    trust = smoothstep(_distance(corners, outline), 0, OUTLINE_BLEND * face.scheme.eye_span(face.landmarks))
    return FaceMesh(face, members, triangles, np.sign(_doubled_areas(corners[triangles])), trust)


def _distance(points: NDArray[np.float64], sides: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of points (count, 2) from the nearest of line segments (some, 2, 2): (count,)."""
    start, along = sides[:, 0], sides[:, 1] - sides[:, 0]
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1))


def _doubled_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas (count,) of triangles (count, 3, 2), doubled."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.asarray(ax * by - ay * bx)


def _barycentric(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Barycentric weights (count, 3) of points (count, 2) in triangles (count, 3, 2), clipped to `EXTRAPOLATION_LIMIT`.

    A drawn triangle takes in points beyond its border, in a thin one by many times its own width.
    """
    (ax, ay), (bx, by), (px, py) = (
        (corners[:, 1] - corners[:, 0]).T,
        (corners[:, 2] - corners[:, 0]).T,
        (points - corners[:, 0]).T,
    )
    area = ax * by - ay * bx
    area = np.where(np.abs(area) < 1e-9, 1e-9, area)
    second, third = (px * by - py * bx) / area, (ax * py - ay * px) / area
    weights = np.clip(
        np.stack([1 - second - third, second, third], axis=1), -EXTRAPOLATION_LIMIT, 1 + EXTRAPOLATION_LIMIT
    )
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _resampled(patch: FlowPatch, points: NDArray[np.float64]) -> NDArray[np.float32]:
    """A patch's flow at points (rows, columns, 2) in source pixels, bilinear; 0 beyond it."""
    rows, columns = patch.flow.shape[:2]
    spacing = (patch.region[2:] - patch.region[:2]) / [columns - 1, rows - 1]
    positions = ((points - patch.region[:2]) / spacing).astype(np.float32)
    return np.asarray(cv2.remap(patch.flow, positions, None, cv2.INTER_LINEAR), dtype=np.float32)
