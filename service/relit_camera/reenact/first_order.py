"""First-order motion of the relit still (thesis 6.3): the default reenactor.

The still's landmarks are moved as the driver's moved since neutral, a dense flow is mixed from local affine maps round
them, and the relit picture is warped at full output resolution.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.face.follow import FaceMotion
from relit_camera.reenact.control_points import (
    COARSE_GRID,
    ControlPoints,
    control_points,
    fine_regions,
    head_anchors,
)
from relit_camera.reenact.dense_motion import DenseMotion, region_around
from relit_camera.reenact.mouth import Mouth
from relit_camera.reenact.placement import inverse_affine, moved_body, still_from_output, visible_box
from relit_camera.reenact.reenactor import Moved, Stage
from relit_camera.reenact.source_face import SourceFace
from relit_camera.reenact.transfer import transfer, transfer_in_frame
from relit_camera.reenact.warp import Box, FlowPatch, Warp
from relit_camera.space.images import Frame, LinearImage, Mask

ENLARGE = 2
"""The still is enlarged by bicubic interpolation before the bilinear warp: as sharp as a bicubic one, and quicker."""
HOLD = 0.08
"""Share of the still's shorter side over which a face that is cut off by the border comes to rest there."""
FEATHER = 0.06
"""Share of the still's width over which a person who is cut off by its side fades out."""


class FirstOrderReenactor:
    """See `Reenactor`."""

    def __init__(self, stage: Stage) -> None:
        self._face = stage.face
        self._size = stage.size
        self._whole = seen_whole(stage.subject.matte)
        anchors = head_anchors(stage.face.pose, stage.face.size) if self._whole else np.zeros((0, 2))
        self._points = control_points(stage.face, anchors)
        self._motion = DenseMotion(stage.options)
        self._mouth = Mouth(stage.face, stage.subject.neutral)
        self._placed = still_from_output(stage.subject.size, stage.size)
        self._alpha = feathered(stage.subject.matte)
        over_black = stage.subject.metadata.over_black
        self._colour_share = (feathered(np.ones_like(self._alpha)) if over_black else self._alpha)[..., None]

    def move(self, relit: LinearImage, motion: FaceMotion, frame: Frame) -> Moved:
        """See `Reenactor.move`."""
        face = self._face
        target = (transfer if self._whole else transfer_in_frame)(face, self._points, motion)
        patches = moved_flow(self._motion, face, self._points, target.points, target.landmarks)
        if not self._whole:
            patches = tuple(held_at_border(patch, face.size) for patch in patches)
        placed = moved_body(self._placed, target.pivot, target.shift, target.scale, face.size[1])
        box = visible_box(placed, face.size, self._size)

        picture, alpha = warped_person(relit, self._alpha, Warp(placed, patches), box)
        to_box = inverse_affine(placed)
        to_box[:, 2] -= box[:2]
        self._mouth.draw(picture, alpha, relit, target.landmarks, target.pose, to_box)
        return Moved(picture, alpha, box[:2])


def seen_whole(matte: Mask) -> bool:
    """Whether there is background beside the head; else the picture's border cuts the face off."""
    return bool(matte[: len(matte) // 2, [0, -1]].mean() < 0.5)


def warped_person(relit: LinearImage, alpha: Mask, warp: Warp, box: Box) -> tuple[LinearImage, Mask]:
    """The relit still under `warp` at the output pixels of `box`: premultiplied picture, and alpha.

    Args:
        relit: (height, width, 3) linear.
        alpha: (height, width) straight alpha of the still.
        warp: output → still.
        box: left, top, right, bottom in output pixels.
    """
    premultiplied = np.dstack([relit * alpha[..., None], alpha])
    large = cv2.resize(premultiplied, None, fx=ENLARGE, fy=ENLARGE, interpolation=cv2.INTER_CUBIC)
    view = warp.apply(np.maximum(large, 0), box, ENLARGE)
    return np.ascontiguousarray(view[..., :3]), np.clip(view[..., 3], 0, 1)


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


def held_at_border(patch: FlowPatch, size: tuple[int, int]) -> FlowPatch:
    """The flow, faded to 0 toward the border of a still of `size` (width, height), which must not move into view."""
    rows, columns = patch.flow.shape[:2]
    x, y = (np.linspace(patch.region[i], patch.region[i + 2], n) for i, n in ((0, columns), (1, rows)))
    inward = np.minimum.outer(np.minimum(y, size[1] - y), np.minimum(x, size[0] - x))
    share = np.clip(inward / (HOLD * min(size)), 0, 1)
    return FlowPatch(patch.flow * (share * share * (3 - 2 * share)).astype(np.float32)[..., None], patch.region)


def feathered(matte: Mask) -> Mask:
    """The matte, faded out toward the sides and the top of the picture where it would be cut off hard."""
    height, width = matte.shape
    reach = max(FEATHER * width, 1.0)
    across = np.clip((np.minimum(np.arange(width), np.arange(width)[::-1]) + 0.5) / reach, 0, 1)
    down = np.clip((np.arange(height) + 0.5) / reach, 0, 1)
    smooth = np.minimum.outer(down, across)
    return np.asarray(matte * (smooth * smooth * (3 - 2 * smooth)), dtype=np.float32)
