"""Where the person is in a live frame: selfie segmentation, steadied over time and fitted to the frame's edges."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from relit_camera.errors import ModelError
from relit_camera.models.registry import model_path
from relit_camera.models.session import Session, SessionOptions, open_session
from relit_camera.space.images import DisplayImage, Frame, Mask

WIDE = "selfie_landscape"
SQUARE = "selfie_square"

_WIDE_FROM = 4 / 3
"""Aspect from which the landscape network is used: it is the cleaner one in a cluttered room."""

_STEADINESS = 0.9
"""Share of the previous mask where the network is wholly undecided."""

_HALVED_FROM = 480
"""Frames with a shorter side from this on are worked on at half size: it is a third of the time, and looks the same."""

_GUIDE_SIDE = 180
"""The guided filter's coefficients are found on a picture with a shorter side of about this many pixels."""

_GUIDE_RADIUS = 3
"""Radius of its window, in pixels of that size."""

_GUIDE_VARIANCE = 4e-3
"""Steps of grey well above the root of this (0.06 of white) count as edges."""

_SURE = (0.25, 0.85)
"""Mask values taken as 0 and 1: below lies the network's haze over clutter, above its doubt within the person."""


class PersonMatte:
    """Finds the person in frame after frame of one source. Not thread-safe: one a worker.

    The networks give a mask of 256 pixels' width without single hairs, and cut off some held objects.
    """

    def __init__(self, options: SessionOptions | None = None, find_model: Callable[[str], Path] = model_path) -> None:
        """Find the models; each is opened with the first frame of its shape.

        Args:
            options: how to run the networks.
            find_model: gives the file of a model's name.

        Raises:
            ModelError: one is not there; the cure is to pull it.
        """
        self._options = options
        self._files = {name: find_model(name) for name in (WIDE, SQUARE)}
        self._sessions: dict[str, Session] = {}
        self._size: tuple[int, int] | None = None
        self._previous: Mask | None = None

    def matte(self, frame: Frame) -> Mask:
        """Alpha of the person, float32 (height, width) of the frame in 0..1, straight.

        Raises:
            ModelError: the network cannot be opened or is another one than its name says.
        """
        if frame.size != self._size:
            self.reset()
            self._size = frame.size
        width, height = frame.size
        image = frame.image
        if min(frame.size) >= _HALVED_FROM:
            image = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        mask = steadied(self._segment(image), self._previous)
        self._previous = mask
        return _enlarged(fitted_to_edges(mask, image), width, height)

    def reset(self) -> None:
        """Forget the previous frame (after a cut, or with a new source)."""
        self._previous = None

    def _segment(self, image: DisplayImage) -> Mask:
        session = self._session(WIDE if image.shape[1] >= _WIDE_FROM * image.shape[0] else SQUARE)
        _, height, width, _ = session.inputs["image"].shape
        stretched = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
        mask: Mask = session.run({"image": np.multiply(stretched, np.float32(1 / 255))[np.newaxis]})["mask"]
        return mask[0, :, :, 0]

    def _session(self, name: str) -> Session:
        if name not in self._sessions:
            session = open_session(self._files[name], name, self._options)
            image, mask = session.inputs.get("image"), session.outputs.get("mask")
            if image is None or mask is None or image.shape != (*mask.shape[:3], 3) or None in image.shape:
                found = f"takes {dict(session.inputs)} and gives {dict(session.outputs)}"
                raise ModelError(f"model {name} {found}, not image [1, h, w, 3] and mask [1, h, w, 1]",
                                 "get it again with `relit models pull`")  # fmt: skip
            self._sessions[name] = session
        return self._sessions[name]


def steadied(mask: Mask, previous: Mask | None) -> Mask:
    """The mask with the previous one mixed in where the network is undecided, both (height, width) in 0..1.

    The share is 0.9 · 4m(1 - m): a pixel that is surely person or surely room follows at once, so nothing drags
    behind. After MediaPipe's SegmentationSmoothingCalculator, with the parabola for its polynomial of the entropy.
    """
    if previous is None:
        return mask
    share = (4 * _STEADINESS) * mask * (1 - mask)
    return mask + share * (previous - mask)


def fitted_to_edges(mask: Mask, image: DisplayImage) -> Mask:
    """Alpha (height, width) of the image's size, from a smaller mask of the same scene whose edges follow the image's.

    The fast guided filter (He and Sun 2015) on grey: alpha is locally a·grey + b, with a and b found at a small size.
    """
    height, width = image.shape[:2]
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    shrink = max(1, round(min(height, width) / _GUIDE_SIDE))
    size = (max(1, width // shrink), max(1, height // shrink))
    guide: Mask = cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    alpha: Mask = cv2.resize(mask, size, interpolation=cv2.INTER_LINEAR)

    mean_guide, mean_alpha = _box(guide), _box(alpha)
    covariance: Mask = _box(guide * alpha) - mean_guide * mean_alpha
    variance: Mask = _box(guide * guide) - mean_guide * mean_guide
    slope = np.asarray(covariance / (variance + _GUIDE_VARIANCE), dtype=np.float32)
    offset: Mask = mean_alpha - slope * mean_guide

    # The stretch from _SURE to 0..1 is folded in while the coefficients are small.
    low, high = _SURE
    gain = np.float32(1 / (high - low))
    slope, offset = (_enlarged(part, width, height) for part in (_box(slope) * gain, (_box(offset) - low) * gain))
    fitted: Mask = cv2.multiply(slope, grey, scale=1 / 255, dtype=cv2.CV_32F)
    cv2.add(fitted, offset, dst=fitted)
    return np.clip(fitted, 0, 1, out=fitted)


def _box(values: Mask) -> Mask:
    side = 2 * _GUIDE_RADIUS + 1
    mean: Mask = cv2.blur(values, (side, side))
    return mean


def _enlarged(values: Mask, width: int, height: int) -> Mask:
    enlarged: Mask = cv2.resize(values, (width, height), interpolation=cv2.INTER_LINEAR)
    return enlarged
