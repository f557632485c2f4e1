"""Flow over the face from a mesh of its landmarks, the nearest surface in front: a turned nose hides its far side.

The first-order mixture knows no surface: where one part of the face moves behind another it averages the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from relit_camera.face.state import HeadPose
from relit_camera.reenact.dense_motion import region_around
from relit_camera.reenact.source_face import SourceFace
from relit_camera.reenact.warp import FlowPatch

GRID = (160, 160)
"""Rows and columns over the face: the ridge of a nose is some ten of them wide."""
MARGIN = 0.1
"""Eye distances round the face that the grid takes in."""
HAND_OVER = 0.2
"""Eye distances inside the face's outline, over which the mesh hands over to the flow round it."""
SUBPIXEL_BITS = 4


@dataclass(frozen=True)
class FaceMesh:
    """The landmarks of a still, triangulated.

    Attributes:
        face: the still's.
        members: (points,) the landmarks that are corners: all but the irises, which roll behind the lids.
        triangles: (count, 3) rows of `members`.
        clockwise: (count,) the sign of each triangle's area in the still.
    """

    face: SourceFace
    members: NDArray[np.intp]
    triangles: NDArray[np.intp]
    clockwise: NDArray[np.float64]

    def over(self, head: FlowPatch, landmarks: NDArray[np.float64], pose: HeadPose) -> FlowPatch:
        """The flow of the mesh over the face, and `head`'s where the mesh does not reach.

        Args:
            head: the flow of the whole head.
            landmarks: (count, 2) where all landmarks go, still pixels.
            pose: of the head that goes there: it says which of two parts is nearer.
        """
        target, source = landmarks[self.members], self.face.landmarks[self.members].astype(np.float64)
        span = self.face.scheme.eye_span(self.face.landmarks)
        region = region_around(target, MARGIN * span, *GRID)
        step = (region.box[2:] - region.box[:2]) / [region.columns - 1, region.rows - 1]
        depth = (self.face.scheme.canonical[self.members] @ pose.rotation.as_matrix().T)[:, 2]
        shown = self._nearest((target - region.box[:2]) / step, depth)
        covered = shown >= 0
        grid = region.grid.reshape(region.rows, region.columns, 2)
        flow = _resampled(head, grid)
        mesh = flow.copy()
        affine = _affine(target[self.triangles], source[self.triangles])
        chosen = affine[shown[covered]]
        mesh[covered] = np.einsum("nj,nji->ni", grid[covered], chosen[:, :2]) + chosen[:, 2] - grid[covered]
        inward = cv2.distanceTransform(covered.astype(np.uint8), cv2.DIST_L2, 3) * step.min()
        share = np.clip(inward / (HAND_OVER * span), 0, 1)[..., None]
        return FlowPatch((flow + share * share * (3 - 2 * share) * (mesh - flow)).astype(np.float32), region.box)

    def _nearest(self, corners: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.int32]:
        """The triangle that shows at each grid point, −1 where none does: (rows, columns).

        Args:
            corners: (points, 2) in grid points.
            depth: (points,) the nearer, the greater.
        """
        shown = np.full(GRID, -1, np.int32)
        facing = _doubled_areas(corners[self.triangles]) * self.clockwise > 0
        order = np.argsort(depth[self.triangles].mean(axis=1))
        fixed = np.round(corners[self.triangles] * (1 << SUBPIXEL_BITS)).astype(np.int32)
        for index in order[facing[order]]:
            cv2.fillConvexPoly(shown, fixed[index], int(index), shift=SUBPIXEL_BITS)
        return shown


def face_mesh(face: SourceFace) -> FaceMesh:
    """The mesh of a still's face."""
    irises = {*face.scheme.right_eye.iris, *face.scheme.left_eye.iris}
    members = np.array([index for index in range(face.scheme.count) if index not in irises], dtype=np.intp)
    corners = face.landmarks[members].astype(np.float64)
    triangles = np.asarray(Delaunay(corners).simplices, dtype=np.intp)
    return FaceMesh(face, members, triangles, np.sign(_doubled_areas(corners[triangles])))


def _doubled_areas(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed areas (count,) of triangles (count, 3, 2), doubled."""
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    return np.asarray(ax * by - ay * bx)


def _affine(corners: NDArray[np.float64], onto: NDArray[np.float64]) -> NDArray[np.float64]:
    """The maps (count, 3, 2), [x y 1] @ map, that bring triangles (count, 3, 2) `onto` others; 0 of flat ones."""
    homogeneous = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
    flat = np.abs(_doubled_areas(corners)) < 1e-9
    homogeneous[flat] = np.eye(3)
    maps = np.linalg.solve(homogeneous, onto)
    maps[flat] = 0
    return np.asarray(maps)


def _resampled(patch: FlowPatch, points: NDArray[np.float64]) -> NDArray[np.float32]:
    """A patch's flow at points (rows, columns, 2) in still pixels, bilinear; 0 beyond it."""
    rows, columns = patch.flow.shape[:2]
    spacing = (patch.region[2:] - patch.region[:2]) / [columns - 1, rows - 1]
    positions = ((points - patch.region[:2]) / spacing).astype(np.float32)
    return np.asarray(cv2.remap(patch.flow, positions, None, cv2.INTER_LINEAR), dtype=np.float32)
