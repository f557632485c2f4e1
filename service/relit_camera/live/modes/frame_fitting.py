"""Fitting live frames, and the motion seen in them, to the output's size: scaled to cover it, cut about the face."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Frame
from relit_camera.base.images.resize import MIDDLE, box_to_fill, crop_to_fill
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.motion.face_follower import FaceMotion


@dataclass(frozen=True)
class CutTunables:
    """How a cut follows a face.

    Attributes:
        headroom: height of the middle of the face above the cut's, in heights of the cut.
        still: the face may be off its place by so much of the cut before the cut moves.
        time_s: time constant with which it does.
        arrived: nearer to its place than this, in shares of the frame, it is there.
        gap_s: after so long without a frame it goes there at once.
    """

    headroom: float = 0.08
    still: float = 0.1
    time_s: float = 0.8
    arrived: float = 5e-4
    gap_s: float = 1.0


TUNABLES = CutTunables()


class FaceCut:
    """Where frames of another shape than the output are cut: about the face, which the cut follows gently."""

    def __init__(self, size: tuple[int, int]) -> None:
        """`size` is (width, height) of the output."""
        self._size = size
        self._middle: NDArray[np.float64] | None = None
        self._goal = np.array(MIDDLE)
        self._time_s = 0.0

    def middle(self, motion: FaceMotion, frame: Frame) -> tuple[float, float]:
        """The cut's middle in the next frame, as shares of its width and height; see `box_to_fill`."""
        passed, self._time_s = frame.time_s - self._time_s, frame.time_s
        width, height = frame.size
        left, top, right, bottom = box_to_fill(frame.size, self._size)
        cut = np.array([(right - left) / width, (bottom - top) / height])
        if (cut >= 1).all() or motion.pose is None:
            return MIDDLE
        if motion.status is not FaceStatus.LOST:
            points = motion.landmarks
            face = (points.min(axis=0) + points.max(axis=0)) / 2 / (width, height)
            wanted = np.clip(face + [0, TUNABLES.headroom * cut[1]], cut / 2, 1 - cut / 2)
            if self._middle is None or not 0 <= passed < TUNABLES.gap_s:
                self._middle = self._goal = wanted
            elif (np.abs(wanted - self._goal) > TUNABLES.still * cut).any():
                self._goal = wanted
        if self._middle is None:
            return MIDDLE
        way = self._goal - self._middle
        if np.abs(way).max() < TUNABLES.arrived:
            self._middle = self._goal
        else:
            self._middle = self._middle + way * (1 - np.exp(-max(passed, 0.0) / TUNABLES.time_s))
        return float(self._middle[0]), float(self._middle[1])


def fit_frame(frame: Frame, size: tuple[int, int], middle: tuple[float, float] = MIDDLE) -> Frame:
    """The frame scaled to cover `size` (width, height) and cut to it about a middle; the frame itself if it fits."""
    return frame if frame.size == size else replace(frame, image=crop_to_fill(frame.image, size, middle))


def fit_motion(
    motion: FaceMotion, size: tuple[int, int], to: tuple[int, int], middle: tuple[float, float] = MIDDLE
) -> FaceMotion:
    """The motion seen in a frame of `size` (width, height), as it is seen in that frame fitted to size `to`."""
    if size == to:
        return motion
    left, top, right, bottom = box_to_fill(size, to, middle)
    scale = np.array([to[0] / (right - left), to[1] / (bottom - top)])
    landmarks = ((motion.landmarks - (left, top)) * scale).astype(np.float32)
    aside = np.array([size[0] - left - right, size[1] - top - bottom]) / 2 * scale
    axis_px = (float(aside[0]), float(aside[1]))
    pose = motion.pose and replace(motion.pose, focal_px=motion.pose.focal_px * scale[0], axis_px=axis_px)
    return replace(motion, landmarks=landmarks, pose=pose)
