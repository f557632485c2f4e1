"""Where the person is in a live frame: selfie segmentation, steadied over time and fitted to the frame's edges.

The matte `recorded:FILE`: plays back where the person was, so that nothing need be downloaded.

Mattes by name: what finds the person in a live frame.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Protocol
from zipfile import BadZipFile, ZipFile

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import InputError, ModelError, NotFoundError
from relit_camera.base.images.image_types import DisplayImage, Frame, Mask
from relit_camera.base.images.resize import resize_to_fill
from relit_camera.base.models.model_store import model_path
from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session
from relit_camera.base.storage import atomic_path

LANDSCAPE_MODEL = "selfie_landscape"
SQUARE_MODEL = "selfie_square"

_LANDSCAPE_ASPECT = 4 / 3
"""Aspect from which the landscape network is used: it is the cleaner one in a cluttered room."""

_TEMPORAL_SMOOTHING = 0.9
"""Share of the previous mask where the network is wholly undecided."""

_HALF_SIZE_FROM_PX = 480
"""Frames with a shorter side from this on are worked on at half size: it is a third of the time, and looks the same."""

_GUIDE_SIDE = 180
"""The guided filter's coefficients are found on a picture with a shorter side of about this many pixels."""

_GUIDE_RADIUS = 3
"""Radius of its window, in pixels of that size."""

_GUIDE_EPSILON = 4e-3
"""Steps of grey well above the root of this (0.06 of white) count as edges."""

_CERTAIN_RANGE = (0.25, 0.85)
"""Mask values taken as 0 and 1: below lies the network's haze over clutter, above its doubt within the person."""


class SelfieMatting:
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
        self._files = {name: find_model(name) for name in (LANDSCAPE_MODEL, SQUARE_MODEL)}
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
        if min(frame.size) >= _HALF_SIZE_FROM_PX:
            image = cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        mask = smooth_over_time(self._segment(image), self._previous)
        self._previous = mask
        return _upsample(refine_edges(mask, image), width, height)

    def reset(self) -> None:
        """Forget the previous frame (after a cut, or with a new source)."""
        self._previous = None

    def _segment(self, image: DisplayImage) -> Mask:
        session = self._session(
            LANDSCAPE_MODEL if image.shape[1] >= _LANDSCAPE_ASPECT * image.shape[0] else SQUARE_MODEL
        )
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


def smooth_over_time(mask: Mask, previous: Mask | None) -> Mask:
    """The mask with the previous one mixed in where the network is undecided, both (height, width) in 0..1.

    The share is 0.9 · 4m(1 - m): a pixel that is surely person or surely room follows at once, so nothing drags
    behind. After MediaPipe's SegmentationSmoothingCalculator, with the parabola for its polynomial of the entropy.
    """
    if previous is None:
        return mask
    share = (4 * _TEMPORAL_SMOOTHING) * mask * (1 - mask)
    return mask + share * (previous - mask)


def refine_edges(mask: Mask, image: DisplayImage) -> Mask:
    """Alpha (height, width) of the image's size, from a smaller mask of the same scene whose edges follow the image's.

    The fast guided filter (He and Sun 2015) on grey: alpha is locally a·grey + b, with a and b found at a small size.
    """
    height, width = image.shape[:2]
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    shrink = max(1, round(min(height, width) / _GUIDE_SIDE))
    size = (max(1, width // shrink), max(1, height // shrink))
    guide: Mask = cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    alpha: Mask = cv2.resize(mask, size, interpolation=cv2.INTER_LINEAR)

    mean_guide, mean_alpha = _box_mean(guide), _box_mean(alpha)
    covariance: Mask = _box_mean(guide * alpha) - mean_guide * mean_alpha
    variance: Mask = _box_mean(guide * guide) - mean_guide * mean_guide
    slope = np.asarray(covariance / (variance + _GUIDE_EPSILON), dtype=np.float32)
    offset: Mask = mean_alpha - slope * mean_guide

    # The stretch from _SURE to 0..1 is folded in while the coefficients are small.
    low, high = _CERTAIN_RANGE
    gain = np.float32(1 / (high - low))
    slope, offset = (
        _upsample(part, width, height) for part in (_box_mean(slope) * gain, (_box_mean(offset) - low) * gain)
    )
    fitted: Mask = cv2.multiply(slope, grey, scale=1 / 255, dtype=cv2.CV_32F)
    cv2.add(fitted, offset, dst=fitted)
    return np.clip(fitted, 0, 1, out=fitted)


def _box_mean(values: Mask) -> Mask:
    side = 2 * _GUIDE_RADIUS + 1
    mean: Mask = cv2.blur(values, (side, side))
    return mean


def _upsample(values: Mask, width: int, height: int) -> Mask:
    enlarged: Mask = cv2.resize(values, (width, height), interpolation=cv2.INTER_LINEAR)
    return enlarged


MAX_BYTES = 1 << 30
"""Of all mattes in memory: ten minutes of 256x256 at 30 frames a second are that much."""
CURE = "name a file that holds `alpha`, uint8 (frames, height, width)"


class RecordedMatting:
    """Answers with the recorded matte of the frame's index; beyond the end it begins again, as a looped file does."""

    def __init__(self, path: Path) -> None:
        """Read what `write_mattes` wrote.

        Raises:
            InputError: the file is missing or holds no mattes.
        """
        try:
            self._alpha = _read_alpha(path)
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror or error}", CURE) from error
        except (ValueError, KeyError, EOFError, NotImplementedError, BadZipFile, zlib.error) as error:
            raise InputError(f"{path} holds no recorded mattes: {error}", CURE) from error

    def matte(self, frame: Frame) -> Mask:
        """Alpha of the person, float32 (height, width) of the frame in 0..1, straight.

        A frame of another shape is one that was scaled to cover its size and cut about its middle.
        """
        alpha = self._alpha[frame.index % len(self._alpha)]
        filled = resize_to_fill(alpha, frame.size, cv2.INTER_LINEAR)
        return np.multiply(filled, np.float32(1 / 255), dtype=np.float32)


def _read_alpha(path: Path) -> NDArray[np.uint8]:
    """The array, after looking at its header: a few bytes of a zip may stand for any amount of memory."""
    with ZipFile(path) as kept, kept.open("alpha.npy") as file:
        shape, _, dtype = _header(file)
        if dtype != np.uint8 or len(shape) != 3 or 0 in shape:
            raise ValueError(f"they are {dtype} {shape}")
        if math.prod(shape) > MAX_BYTES:
            raise ValueError(f"they are {math.prod(shape) >> 20} MiB, more than {MAX_BYTES >> 20}")
        file.seek(0)  # the very member: np.load would take one that is called `alpha` instead
        alpha: NDArray[np.uint8] = np.lib.format.read_array(file, allow_pickle=False)
        return alpha


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        return np.lib.format.read_array_header_1_0(file)
    return np.lib.format.read_array_header_2_0(file)


def write_mattes(path: Path, mattes: Sequence[Mask]) -> None:
    """Keep mattes (height, width) 0..1 in 8 bits.

    Raises:
        StorageError: the file cannot be written.
    """
    alpha = np.rint(np.clip(np.stack(mattes), 0, 1) * 255).astype(np.uint8)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, alpha=alpha)


class Matting(Protocol):
    """Finds the person in frame after frame of one source. Not thread-safe: one a worker."""

    def matte(self, frame: Frame) -> Mask:
        """Alpha of the person, float32 (height, width) of the frame in 0..1, straight.

        Raises:
            ModelError: a network is missing or unusable.
        """
        ...


def matting_factory(name: str, options: SessionOptions) -> Callable[[], Matting]:
    """What opens the matte `selfie` (networks, found when they are first needed) or `recorded:FILE` (read at once).

    Raises:
        NotFoundError: no such matte.
        InputError: `recorded:FILE` names no recorded mattes.
    """
    plain, _, argument = name.partition(":")
    if name == "selfie":
        return lambda: SelfieMatting(options)
    if plain == "recorded" and argument:
        recorded = RecordedMatting(Path(argument))
        return lambda: recorded
    raise NotFoundError(f"no matte is called '{name}'", "use selfie, or recorded:FILE.npz")
