"""Where the face is in a blinking video: by the detector, or, where that is not installed, by what the flash lights."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError, ModelError
from relit_camera.capture.film.face_circle import FaceCircle, find_face_circle
from relit_camera.capture.film.flash.flash_signal import BrightnessGrid
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass
from relit_camera.face.tracking.face_detector import FaceDetector

log = logging.getLogger(__name__)

_LIT = 0.15
"""Share of the strongest added light from which a cell is lit: hair and clothes, not the wall behind."""
_USUAL_LIGHT = 75
"""Percentile of the light that flashes add to a cell: wherever they come from, many reach it."""
_HEAD_HEIGHT = 1.1
"""Of a head with its hair, in widths, down to which no shoulder begins."""
_CENTRE = 1.45
"""From the crown to the face's centre, in half widths of the head."""


@dataclass(frozen=True)
class LocatedFace:
    """A face.

    Attributes:
        circle: about it, in the video's pixels.
        by: what found it; `flash` is rough: a head's width below the topmost thing that the flash lights.
    """

    circle: FaceCircle
    by: Literal["detector", "flash", "user"]


def locate_face(brightness: BrightnessGrid, flashes: Flashes, detector: FaceDetector | None = None) -> LocatedFace:
    """Where the face is in a capture.

    Args:
        brightness: the video's brightness.
        flashes: what its frames are.
        detector: the public one unless given; if that is not installed, the flash tells.

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


def locate_head_by_flash(brightness: BrightnessGrid, flashes: Flashes) -> FaceCircle:
    """The upper end of the largest thing that the flash lights, in the video's pixels.

    Raises:
        CaptureError: it does not look like a head over shoulders.
    """
    cells = brightness.cells / flashes.signal.gains[:, None, None]
    lit, unlit = cells[flashes.indices(FrameClass.BRIGHT)], cells[flashes.indices(FrameClass.DARK)]
    added = np.percentile(lit, _USUAL_LIGHT, axis=0) - np.median(unlit, axis=0)
    largest = _largest(added > _LIT * np.percentile(added, 98))
    widths, rows = largest.sum(axis=1), np.flatnonzero(largest.any(axis=1))
    top = end = int(rows[0])
    widest = 0
    while end < len(widths) and end - top < _HEAD_HEIGHT * max(widest, 1) and widths[end]:
        widest = max(widest, int(widths[end]))
        end += 1
    if not 3 <= widest <= 0.9 * largest.shape[1] or end - top < widest / 2:
        what = "nothing that the flash lights looks like a head"
        raise CaptureError(what, "name the face's place, its centre and half its height in pixels: --face X,Y,RADIUS")
    columns = np.flatnonzero(largest[top:end].any(axis=0))
    width, height = brightness.size[0] / largest.shape[1], brightness.size[1] / largest.shape[0]
    radius = widest * width / 2
    return FaceCircle(float(columns.mean() + 0.5) * width, top * height + _CENTRE * radius, radius)


def _largest(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest connected part of a mask (rows, columns)."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    # Label 0 is the background.
    return np.asarray(labels == 1 + stats[1:, cv2.CC_STAT_AREA].argmax())
