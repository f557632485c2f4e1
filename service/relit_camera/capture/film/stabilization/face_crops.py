"""A square about the face, seen as if the face had not moved.

Squares about the face out of the frames that count, cut where corners say that it went.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.video.video_readers import LumaVideoReader
from relit_camera.capture.alignment.rigid_transform import RigidTransform, Size, warp_affine
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.stabilization.corner_tracking import CornerMatch, CornerTracker, local_contrast


@dataclass(frozen=True)
class CropWindow:
    """A square of whole pixels in the reference picture.

    Attributes:
        left, top: its corner.
        side: in pixels.
        size: of the whole picture.
    """

    left: int
    top: int
    side: int
    size: Size

    @classmethod
    def about(cls, circle: FaceCircle, reach: float, size: Size) -> CropWindow:
        """The square about a circle so many times as large."""
        side = 2 * round(circle.radius * reach)
        return cls(round(circle.x) - side // 2, round(circle.y) - side // 2, side, size)

    def cut(self, picture: NDArray[np.float32], transform: RigidTransform) -> NDArray[np.float32]:
        """The square (side, side) out of a frame's picture (height, width) after its transform to the reference."""
        matrix = transform.matrix(self.size)
        matrix[:, 2] -= self.left, self.top
        return warp_affine(picture, matrix, (self.side, self.side))

    def disc(self, circle: FaceCircle, share: float) -> NDArray[np.float32]:
        """Weights (side, side): 1 in a share of the circle's radius, falling to 0 over the next tenth of it."""
        place = np.arange(self.side) + 0.5
        distance = np.hypot(place + self.left - circle.x, place[:, None] + self.top - circle.y) / circle.radius
        return np.asarray(np.clip((share + 0.1 - distance) / 0.1, 0, 1), np.float32)

    def in_picture(self, transform: RigidTransform) -> RigidTransform:
        """A transform about the square's centre as one about the picture's."""
        centre = np.array(self.size) / 2
        middle = np.array([self.left, self.top]) + self.side / 2
        turn = RigidTransform(transform.rotation_deg).matrix((0, 0))[:, :2]
        x, y = middle - centre - turn @ (middle - centre) + (transform.x, transform.y)
        return RigidTransform(transform.rotation_deg, float(x), float(y))

    def in_window(self, transform: RigidTransform) -> RigidTransform:
        """A transform about the picture's centre as one about the square's."""
        nothing = self.in_picture(RigidTransform(transform.rotation_deg))
        return RigidTransform(transform.rotation_deg, transform.x - nothing.x, transform.y - nothing.y)


Indices = NDArray[np.intp]

_RADIUS_PX = 128.0
"""A larger face is scaled down to this."""
_SEARCHED = 2.0
"""Reach of the square in which corners are followed, in radii: how far a head may go."""
_REACH = 0.95
"""Reach of the squares that are kept."""
_LEAST_CORNERS = 8


@dataclass(frozen=True, eq=False)
class FaceCrops:
    """Squares about the face, cut out of some frames.

    Attributes:
        index: (count,) of the frames.
        codes: (count, side, side) float16 luma.
        matches: of each frame, by corners alone, to the first one; the squares are cut accordingly. A bright frame has
            that of the dark one before it.
        window, circle: of the squares and of the face in the first frame, in pictures so many times (`scale`) as large
            as the video's.
    """

    index: Indices
    codes: NDArray[np.float16]
    matches: list[CornerMatch]
    window: CropWindow
    circle: FaceCircle
    scale: float

    @property
    def transforms(self) -> list[RigidTransform]:
        """Those of the matches."""
        return [match.transform for match in self.matches]

    def only(self, chosen: NDArray[np.bool_]) -> FaceCrops:
        """Some of them, by a mask (count,)."""
        matches = [match for match, kept in zip(self.matches, chosen, strict=True) if kept]
        return replace(self, index=self.index[chosen], codes=self.codes[chosen], matches=matches)

    def of(self, frames: Indices) -> FaceCrops:
        """Those of these frames."""
        return self.only(np.isin(self.index, frames))


def crop_faces(
    path: Path, dark: Indices, bright: Indices, circle: FaceCircle, threads: int, progress: Callable[[int], None]
) -> FaceCrops:
    """Follow corners through the dark frames of a video, and keep squares of dark and bright ones.

    Args:
        path: the video.
        dark: indices of its dark frames.
        bright: of its bright ones.
        circle: of the face, in the video's pixels.
        threads: of the decoder.
        progress: called with the number of frames looked at.

    Raises:
        VideoError: the video cannot be read.
        CaptureError: nothing in the circle can be followed.
    """
    followed = frozenset(dark.tolist())
    scale = min(1.0, _RADIUS_PX / circle.radius)
    small = circle.scaled(scale)
    tracker: CornerTracker | None = None
    index, codes, matches = [], [], []
    with LumaVideoReader(path, only=followed | frozenset(bright.tolist()), threads=threads) as video:
        size = (round(video.info.width * scale), round(video.info.height * scale))
        searched, window = CropWindow.about(small, _SEARCHED, size), CropWindow.about(small, _REACH, size)
        now: CornerMatch | None = None
        for frame in video:
            picture = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA) if scale < 1 else frame.image
            if frame.index in followed:
                square = local_contrast(searched.cut(picture, RigidTransform()))
                tracker = tracker or _tracker(square, small.moved(-searched.left, -searched.top))
                found = tracker.track(square)
                now = found and replace(found, transform=searched.in_picture(found.transform))
            if now is not None:
                index.append(frame.index)
                codes.append(window.cut(picture, now.transform).astype(np.float16))
                matches.append(now)
            progress(frame.index + 1)
    kept = np.stack(codes) if codes else np.zeros((0, window.side, window.side), np.float16)
    return FaceCrops(np.array(index, np.intp), kept, matches, window, small, scale)


def _tracker(square: NDArray[np.uint8], circle: FaceCircle) -> CornerTracker:
    tracker = CornerTracker(square, circle)
    if tracker.corners < _LEAST_CORNERS:
        what = f"only {tracker.corners} points of the face can be followed in the dark frames"
        raise CaptureError(what, "make the room a little brighter, so that the face shows without the flash")
    return tracker
