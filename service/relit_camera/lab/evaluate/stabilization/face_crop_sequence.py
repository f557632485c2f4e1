"""Input of the stabilizers: crops around the face, and its landmarks, in a capture's bright and dark frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Points
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass
from relit_camera.capture.film.stabilization.face_crops import CropWindow
from relit_camera.face.face_state import Tracker
from relit_camera.lab.evaluate.stabilization.baseline_stabilizers import GrayImages

_CROP_RADII = 2.0
"""Half the side of the crops, in radii of the face; the head must stay inside."""
_MAX_FACE_RADIUS_PX = 128.0
"""Largest radius of the face; larger faces are scaled down to it."""


@dataclass(frozen=True, eq=False)
class FaceCropSequence:
    """Crops of the bright and dark frames of a capture.

    Attributes:
        index: (count,) growing, of the frames.
        bright: (count,) which of them are bright; the others are dark.
        squares: (count, side, side) uint8 gray crops, all at the same place.
        landmarks: of each frame's face, in the video's pixels; (0, 2) where there is none, and without a tracker.
        window, circle: of the crops and of the face, in pixels of the scaled video.
        scale: size of the scaled video relative to the video.
    """

    index: NDArray[np.intp]
    bright: NDArray[np.bool_]
    squares: GrayImages
    landmarks: Sequence[Points]
    window: CropWindow
    circle: FaceCircle
    scale: float

    @property
    def circle_in_square(self) -> FaceCircle:
        """The face's circle, in the squares' pixels."""
        return self.circle.moved(-self.window.left, -self.window.top)

    def in_video(self, transform: RigidTransform | None) -> RigidTransform | None:
        """A transform about a square's center as one about the center of the video's picture."""
        return transform and self.window.in_picture(transform).scaled(1 / self.scale)


def read_face_crops(
    path: Path, flashes: Flashes, circle: FaceCircle, tracker: Tracker | None, progress: Callable[[int], None]
) -> FaceCropSequence:
    """Read a video's bright and dark frames.

    Args:
        path: the video.
        flashes: what its frames are.
        circle: of the face, in the video's pixels.
        tracker: of landmarks; it is run on every frame, in order.
        progress: called with the number of frames read.

    Raises:
        VideoError: the video cannot be read.
    """
    scale = min(1.0, _MAX_FACE_RADIUS_PX / circle.radius)
    small = circle.scaled(scale)
    index, bright, squares, landmarks = [], [], [], []
    with VideoReader(path, accurate=False) as video:
        size = (round(video.info.width * scale), round(video.info.height * scale))
        window = CropWindow.about(small, _CROP_RADII, size)
        for frame in video:
            state = tracker.track(frame) if tracker else None
            kind = flashes.frames[frame.index].kind
            if kind in (FrameClass.BRIGHT, FrameClass.DARK):
                gray = cv2.cvtColor(frame.image, cv2.COLOR_RGB2GRAY)
                picture = cv2.resize(gray, size, interpolation=cv2.INTER_AREA).astype(np.float32)
                index.append(frame.index)
                bright.append(kind is FrameClass.BRIGHT)
                squares.append(np.clip(window.crop(picture, RigidTransform()), 0, 255).astype(np.uint8))
                landmarks.append(state.landmarks if state else np.zeros((0, 2), np.float32))
            progress(frame.index + 1)
    return FaceCropSequence(np.array(index), np.array(bright), np.stack(squares), landmarks, window, small, scale)
