"""Crops of the face from the bright and dark frames of a film, moved along with the face as its corners show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Indices
from relit_camera.base.errors import CaptureError
from relit_camera.base.video.video_readers import LumaVideoReader
from relit_camera.capture.alignment.rigid_transform import RigidTransform, Size, warp_affine
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.stabilization.corner_tracking import CornerMatch, CornerTracker, local_contrast

MAX_RADIUS_PX = 128.0
"""Radius of the face to which larger ones are scaled down."""
_SEARCH_RADII = 2.0
"""Half the side of the square in which corners are tracked, in radii: how far a head may move."""
_CROP_RADII = 0.95
"""Half the side of the crops that are kept, in radii."""
_MIN_CORNERS = 8
"""Least number of corners that can be tracked."""


@dataclass(frozen=True)
class CropWindow:
    """A square of whole pixels in the reference picture.

    Attributes:
        left, top: its upper left corner, pixels.
        side: in pixels.
        size: width and height of the whole picture.
    """

    left: int
    top: int
    side: int
    size: Size

    @classmethod
    def about(cls, circle: FaceCircle, reach: float, size: Size) -> CropWindow:
        """The square about a circle with half a side of `reach` radii, in a picture of this size."""
        side = 2 * round(circle.radius * reach)
        return cls(round(circle.x) - side // 2, round(circle.y) - side // 2, side, size)

    def crop(self, picture: NDArray[np.float32], transform: RigidTransform) -> NDArray[np.float32]:
        """The square (side, side) of a frame's picture (height, width), aligned by its transform to the reference."""
        matrix = transform.matrix(self.size)
        matrix[:, 2] -= self.left, self.top
        return warp_affine(picture, matrix, (self.side, self.side))

    def disc(self, circle: FaceCircle, fraction: float) -> NDArray[np.float32]:
        """Weights (side, side): 1 within a fraction of the circle's radius, falling to 0 over a tenth of the radius."""
        center = np.arange(self.side) + 0.5
        distance = np.hypot(center + self.left - circle.x, center[:, None] + self.top - circle.y) / circle.radius
        return np.asarray(np.clip((fraction + 0.1 - distance) / 0.1, 0, 1), np.float32)

    def in_picture(self, transform: RigidTransform) -> RigidTransform:
        """A transform about the square's center as one about the picture's."""
        center = np.array(self.size) / 2
        middle = np.array([self.left, self.top]) + self.side / 2
        turn = RigidTransform(transform.rotation_deg).matrix((0, 0))[:, :2]
        x, y = middle - center - turn @ (middle - center) + (transform.x, transform.y)
        return RigidTransform(transform.rotation_deg, float(x), float(y))

    def in_window(self, transform: RigidTransform) -> RigidTransform:
        """A transform about the picture's center as one about the square's."""
        turned = self.in_picture(RigidTransform(transform.rotation_deg))
        return RigidTransform(transform.rotation_deg, transform.x - turned.x, transform.y - turned.y)


@dataclass(frozen=True, eq=False)
class FaceCrops:
    """Crops of the face from some frames.

    Attributes:
        index: (count,) of the frames.
        codes: (count, side, side) float16 luma.
        matches: of each frame with the first dark one, by corners; the crops are aligned by it. A bright frame has the
            match of the dark one before it.
        window, circle: of the crops and of the face in the first dark frame, in pictures scaled by `scale`.
        scale: size of those pictures relative to the film's.
    """

    index: Indices
    codes: NDArray[np.float16]
    matches: list[CornerMatch]
    window: CropWindow
    circle: FaceCircle
    scale: float

    @property
    def transforms(self) -> list[RigidTransform]:
        """Transforms of the matches."""
        return [match.transform for match in self.matches]

    def subset(self, chosen: NDArray[np.bool_]) -> FaceCrops:
        """Some of the crops, by a mask (count,)."""
        matches = [match for match, kept in zip(self.matches, chosen, strict=True) if kept]
        return replace(self, index=self.index[chosen], codes=self.codes[chosen], matches=matches)

    def of_frames(self, frames: Indices) -> FaceCrops:
        """The crops of these frames."""
        return self.subset(np.isin(self.index, frames))


def crop_faces(
    path: Path, dark: Indices, bright: Indices, circle: FaceCircle, threads: int, progress: Callable[[int], None]
) -> FaceCrops:
    """Track corners through the dark frames of a film, and crop the face from dark and bright frames.

    Args:
        path: the film.
        dark: indices of its dark frames.
        bright: indices of its bright frames.
        circle: of the face, in the film's pixels.
        threads: of the decoder.
        progress: called with the number of frames read.

    Raises:
        VideoError: the video cannot be read.
        CaptureError: too few corners in the circle can be tracked.
    """
    tracked = frozenset(dark.tolist())
    scale = min(1.0, MAX_RADIUS_PX / circle.radius)
    small = circle.scaled(scale)
    tracker: CornerTracker | None = None
    index, codes, matches = [], [], []
    with LumaVideoReader(path, only=tracked | frozenset(bright.tolist()), threads=threads) as video:
        size = (round(video.info.width * scale), round(video.info.height * scale))
        searched, window = CropWindow.about(small, _SEARCH_RADII, size), CropWindow.about(small, _CROP_RADII, size)
        now: CornerMatch | None = None
        for frame in video:
            picture = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA) if scale < 1 else frame.image
            if frame.index in tracked:
                square = local_contrast(searched.crop(picture, RigidTransform()))
                tracker = tracker or _tracker(square, small.moved(-searched.left, -searched.top))
                found = tracker.track(square)
                now = found and replace(found, transform=searched.in_picture(found.transform))
            if now is not None:
                index.append(frame.index)
                codes.append(window.crop(picture, now.transform).astype(np.float16))
                matches.append(now)
            progress(frame.index + 1)
    kept = np.stack(codes) if codes else np.zeros((0, window.side, window.side), np.float16)
    return FaceCrops(np.array(index, np.intp), kept, matches, window, small, scale)


def _tracker(square: NDArray[np.uint8], circle: FaceCircle) -> CornerTracker:
    """A tracker of the corners in a circle of the first picture, if there are enough."""
    tracker = CornerTracker(square, circle)
    if tracker.corners < _MIN_CORNERS:
        what = f"only {tracker.corners} points of the face can be followed in the dark frames"
        raise CaptureError(what, "make the room a little brighter, so that the face shows without the flash")
    return tracker
