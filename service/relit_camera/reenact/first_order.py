"""First-order motion of the relit still (thesis 6.3): the default reenactor.

The still's landmarks are moved as the driver's moved since neutral, a dense flow is mixed from local affine maps round
them, and the relit picture is warped at full output resolution.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.face.follow import FaceMotion
from relit_camera.reenact.control_points import COARSE_GRID, ControlPoints, control_points, fine_regions
from relit_camera.reenact.dense_motion import DenseMotion, region_around
from relit_camera.reenact.mouth import Mouth
from relit_camera.reenact.placement import inverse_affine, moved_body, still_from_output, visible_box
from relit_camera.reenact.reenactor import Moved, Stage
from relit_camera.reenact.source_face import SourceFace
from relit_camera.reenact.transfer import transfer
from relit_camera.reenact.warp import FlowPatch, Warp
from relit_camera.space.images import Frame, LinearImage, Mask

ENLARGE = 2
"""The still is enlarged by bicubic interpolation before the bilinear warp: as sharp as a bicubic warp, a third of its time."""
FEATHER = 0.06
"""Share of the still's width over which a person who is cut off by its side fades out."""


class FirstOrderReenactor:
    """See `Reenactor`."""

    def __init__(self, stage: Stage) -> None:
        self._face = stage.face
        self._size = stage.size
        self._points = control_points(stage.face)
        self._motion = DenseMotion(stage.options)
        self._mouth = Mouth(stage.face)
        self._placed = still_from_output(stage.subject.size, stage.size)
        self._alpha = feathered(stage.subject.matte)
        # Where the picture has no matte, the person fills it, and moving the body would move the picture's edges.
        self._free = bool(stage.subject.matte[: stage.subject.size[1] // 2, [0, -1]].mean() < 0.5)

    def move(self, relit: LinearImage, motion: FaceMotion, frame: Frame) -> Moved:
        """See `Reenactor.move`."""
        face = self._face
        target = transfer(face, self._points, motion)
        patches = moved_flow(self._motion, face, self._points, target.points, target.landmarks)
        placed = self._placed
        if self._free:
            placed = moved_body(placed, target.pivot, target.shift, target.scale, face.size[1])
        box = visible_box(placed, face.size, self._size)

        premultiplied = np.dstack([relit * self._alpha[..., None], self._alpha])
        large = cv2.resize(premultiplied, None, fx=ENLARGE, fy=ENLARGE, interpolation=cv2.INTER_CUBIC)
        view = Warp(placed, patches).apply(np.maximum(large, 0), box, ENLARGE)

        picture, alpha = np.ascontiguousarray(view[..., :3]), np.clip(view[..., 3], 0, 1)
        to_box = inverse_affine(placed)
        to_box[:, 2] -= box[:2]
        self._mouth.draw(picture, alpha, relit, target.landmarks, target.pose, to_box)
        return Moved(picture, alpha, box[:2])


def moved_flow(
    motion: DenseMotion,
    face: SourceFace,
    points: ControlPoints,
    target: NDArray[np.float64],
    landmarks: NDArray[np.float64],
) -> tuple[FlowPatch, ...]:
    """The flow that brings the still's control points to `target`: coarse over the head, fine at eyes and mouth.

    Args:
        motion: the graph.
        face: the still's face.
        points: its control points.
        target: (count, 2) where they must go, still pixels.
        landmarks: (count, 2) where all landmarks go, still pixels.
    """
    head = region_around(np.vstack([points.source, target]), 0.6 * points.unit, *COARSE_GRID)
    regions = [head, *fine_regions(face, landmarks)]
    scheme = face.scheme
    up = scheme.eye_centres(landmarks.astype(np.float32)).mean(axis=0) - landmarks[list(scheme.lips)].mean(axis=0)
    influence = points.influence(target, up / max(float(np.linalg.norm(up)), 1e-6))
    return motion.flow(points.source, influence, points.radius, points.unit, regions)


def feathered(matte: Mask) -> Mask:
    """The matte, faded out toward the sides and the top of the picture where it would be cut off hard."""
    height, width = matte.shape
    reach = max(FEATHER * width, 1.0)
    across = np.clip((np.minimum(np.arange(width), np.arange(width)[::-1]) + 0.5) / reach, 0, 1)
    down = np.clip((np.arange(height) + 0.5) / reach, 0, 1)
    smooth = np.minimum.outer(down, across)
    return np.asarray(matte * (smooth * smooth * (3 - 2 * smooth)), dtype=np.float32)
