"""Fitting a live frame, and the motion seen in it, to the output's size: scaled to cover it, cut about the middle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Frame
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.face.motion.face_follower import FaceMotion


def fit_frame(frame: Frame, size: tuple[int, int]) -> Frame:
    """The frame scaled to cover `size` (width, height) and cut to it about its middle; the frame itself if it fits."""
    return frame if frame.size == size else replace(frame, image=crop_to_fill(frame.image, size))


def fit_motion(motion: FaceMotion, size: tuple[int, int], to: tuple[int, int]) -> FaceMotion:
    """The motion seen in a frame of `size` (width, height), as it is seen in that frame fitted to size `to`."""
    scale, shift = _cover_transform(size, to)
    pose = motion.pose and replace(motion.pose, focal_px=motion.pose.focal_px * scale)
    return replace(motion, landmarks=(motion.landmarks * scale + shift).astype(np.float32), pose=pose)


def _cover_transform(size: tuple[int, int], to: tuple[int, int]) -> tuple[float, NDArray[np.float64]]:
    """Scale and shift (2,) that let a picture of `size` (width, height) cover one of size `to`, middle on middle."""
    scale = max(to[0] / size[0], to[1] / size[1])
    return scale, (np.array(to) - scale * np.array(size)) / 2
