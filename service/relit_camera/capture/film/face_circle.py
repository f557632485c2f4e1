"""Where the face is in a capture."""

from __future__ import annotations

from typing import NamedTuple

from relit_camera.base.errors import ModelError, VideoError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.models.model_store import model_path
from relit_camera.face.tracking.face_detector import FaceDetector

_CURE = "name its place, the face's centre and half its height in pixels: --face X,Y,RADIUS"


class FaceCircle(NamedTuple):
    """A circle about a face, brow to chin, in pixels of the upright video; pixel centres at integers + ½."""

    x: float
    y: float
    radius: float

    def scaled(self, factor: float) -> FaceCircle:
        """In a picture so many times as large."""
        return FaceCircle(self.x * factor, self.y * factor, self.radius * factor)

    def moved(self, x: float, y: float) -> FaceCircle:
        """So much farther to the right and down."""
        return FaceCircle(self.x + x, self.y + y, self.radius)


def find_face_circle(still: DisplayImage, detector: FaceDetector | None = None) -> FaceCircle:
    """The largest face in a picture: the circle inscribed in a square about it.

    Args:
        still: uint8 sRGB.
        detector: the public one unless given.

    Raises:
        ModelError: the detector is not installed.
        VideoError: there is no face.
    """
    try:
        detector = detector or FaceDetector(model_path("face_detector_yunet"))
    except ModelError as error:
        raise ModelError(f"the face cannot be looked for: {error.what}", f"{error.cure}, or {_CURE}") from error
    found = detector.detect(still)
    if found is None:
        raise VideoError("no face found", f"show the face upright and whole, or {_CURE}")
    x, y, width, height = found.box
    return FaceCircle(x + width / 2, y + height / 2, max(width, height) / 2)
