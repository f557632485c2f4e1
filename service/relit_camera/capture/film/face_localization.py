"""Where the face is in a capture film: by the face detector or, if none is installed, by what the flash lights."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError, ConfigError, ModelError, VideoError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.video.video_readers import LinearVideoReader
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass
from relit_camera.face.detection.face_detector import FaceDetector
from relit_camera.face.detection.installed_detector import open_face_detector

log = logging.getLogger(__name__)

_FACE_CURE = "name its place, the face's centre and half its height in pixels: --face X,Y,RADIUS"


@dataclass(frozen=True)
class LitHeadTunables:
    """How the head is found by what the flash lights, without a detector.

    Attributes:
        light_percentile: percentile of the light that flashes add to a cell: wherever they come from, many reach it.
        min_light: fraction of the strongest added light from which a cell is lit: hair and clothes are, not the wall
            behind.
        head_height: height of a head with its hair above the shoulders, in widths.
        center: distance of the face's center from the crown, in half widths of the head.
    """

    light_percentile: float = 75
    min_light: float = 0.15
    head_height: float = 1.1
    center: float = 1.45


_LIT_HEAD = LitHeadTunables()


@dataclass(frozen=True)
class LocatedFace:
    """A face in a film.

    Attributes:
        circle: about the face, in the film's pixels.
        by: what found it; `flash` is rough: the top of the largest thing that the flash lights.
    """

    circle: FaceCircle
    by: Literal["detector", "flash", "user"]


def locate_face(brightness: BrightnessGrid, flashes: Flashes, detector: FaceDetector | None = None) -> LocatedFace:
    """Find the face.

    Args:
        brightness: of the film.
        flashes: of the film.
        detector: the installed one unless given; without either, the face is found by what the flash lights.

    Raises:
        VideoError: the detector sees no face.
        CaptureError: there is no detector, and the flash lights nothing like a head.
    """
    try:
        circle = find_face_circle(brightness.brightest_picture, detector)
    except ModelError as error:
        log.warning("%s; the face is taken to be what the flash lights at the top", error)
        return LocatedFace(locate_head_by_flash(brightness, flashes), "flash")
    return LocatedFace(circle.scaled(brightness.size[0] / brightness.brightest_picture.shape[1]), "detector")


def find_face_circle(picture: DisplayImage, detector: FaceDetector | None = None) -> FaceCircle:
    """Circle about the largest face in a picture, inscribed in the square about the detector's box.

    Args:
        picture: uint8 sRGB (height, width, 3).
        detector: the installed one unless given.

    Raises:
        ModelError: the detector is not installed.
        VideoError: there is no face.
    """
    try:
        detector = detector or open_face_detector()
    except ModelError as error:
        raise ModelError(f"the face cannot be looked for: {error.what}", f"{error.cure}, or {_FACE_CURE}") from error
    found = detector.detect(picture)
    if found is None:
        raise VideoError("no face found", f"show the face upright and whole, or {_FACE_CURE}")
    x, y, width, height = found.box
    return FaceCircle(x + width / 2, y + height / 2, max(width, height) / 2)


def locate_head_by_flash(brightness: BrightnessGrid, flashes: Flashes) -> FaceCircle:
    """The face of the head at the top of the largest thing that the flash lights, in the film's pixels.

    Args:
        brightness: of the film.
        flashes: of the film.

    Raises:
        CaptureError: that does not look like a head over shoulders.
    """
    cells = brightness.cells / flashes.signal.gains[:, None, None]
    lit, unlit = cells[flashes.indices(FrameClass.BRIGHT)], cells[flashes.indices(FrameClass.DARK)]
    added = np.percentile(lit, _LIT_HEAD.light_percentile, axis=0) - np.median(unlit, axis=0)
    largest = _largest_component(added > _LIT_HEAD.min_light * np.percentile(added, 98))
    widths, rows = largest.sum(axis=1), np.flatnonzero(largest.any(axis=1))
    top = end = int(rows[0])
    widest = 0
    while end < len(widths) and end - top < _LIT_HEAD.head_height * max(widest, 1) and widths[end]:
        widest = max(widest, int(widths[end]))
        end += 1
    if not 3 <= widest <= 0.9 * largest.shape[1] or end - top < widest / 2:
        what = "nothing that the flash lights looks like a head"
        raise CaptureError(what, "name the face's place, its centre and half its height in pixels: --face X,Y,RADIUS")
    columns = np.flatnonzero(largest[top:end].any(axis=0))
    width, height = brightness.size[0] / largest.shape[1], brightness.size[1] / largest.shape[0]
    radius = widest * width / 2
    return FaceCircle(float(columns.mean() + 0.5) * width, top * height + _LIT_HEAD.center * radius, radius)


def require_face_in_picture(face: FaceCircle, video: Path) -> None:
    """Check that the middle of a given face is inside the film's picture, before a frame is read.

    Raises:
        ConfigError: it is not.
        VideoError: the film cannot be read.
    """
    with LinearVideoReader(video) as reader:
        width, height = reader.info.width, reader.info.height
    if not (0 <= face.x < width and 0 <= face.y < height):
        what = f"the face at {face.x:g}, {face.y:g} is outside of the picture, which is {width}x{height}"
        raise ConfigError(what, "give --face in pixels of the upright film, or leave it out")


def median_eye_distance_px(pictures: Iterable[DisplayImage], detector: FaceDetector) -> float | None:
    """Median distance of the pupils in pixels over pictures of one size; None where no face is found."""
    found = (detector.detect(picture) for picture in pictures)
    distances = [float(np.linalg.norm(face.eyes[0] - face.eyes[1])) for face in found if face is not None]
    return float(np.median(distances)) if distances else None


def _largest_component(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest connected component of a mask (rows, columns)."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    # Label 0 is the background.
    return np.asarray(labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax())
