"""Matting: alpha of the person in live frames, by segmentation networks (`selfie`) or from a file (`recorded:FILE`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from relit_camera.base.errors import InputError, ModelError, NotFoundError
from relit_camera.base.images.image_types import Alpha, DisplayImage, Frame, Mask
from relit_camera.base.images.resize import halve, resize_to_fill
from relit_camera.base.models.model_store import model_path
from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session
from relit_camera.face.matte_files import UNREADABLE_MATTES, read_mattes

LANDSCAPE_MODEL = "selfie_landscape"
SQUARE_MODEL = "selfie_square"

RECORDED_CURE = "name a file that holds `alpha`, uint8 (frames, height, width)"


class Matting(Protocol):
    """Finds the person in consecutive frames of one source. Not thread-safe: each worker has its own."""

    def matte(self, frame: Frame) -> Alpha:
        """Alpha of the person, of the frame's size.

        Raises:
            ModelError: a network is missing or unusable.
        """
        ...


def matting_factory(name: str, options: SessionOptions) -> Callable[[], Matting]:
    """What opens the matting of a name: `selfie` or `recorded:FILE`.

    Networks are looked for when the matting is opened, a file is read at once.

    Raises:
        NotFoundError: no such matting.
        InputError: `recorded:FILE` names no recorded mattes.
    """
    plain, _, argument = name.partition(":")
    if name == "selfie":
        return lambda: SelfieMatting(options)
    if plain == "recorded" and argument:
        recorded = RecordedMatting(Path(argument))
        return lambda: recorded
    raise NotFoundError(f"no matte is called '{name}'", "use selfie, or recorded:FILE.npz")


@dataclass(frozen=True)
class MattingTunables:
    """Numbers of `SelfieMatting`, chosen by looking at mattes of real recordings.

    `pytest tests/face/test_matting.py` checks them on such recordings: overlap with a green screen's matte,
    and flicker of a head that keeps still.

    Attributes:
        landscape_aspect: width over height from which the landscape network is used. It is the cleaner one in a
            cluttered room.
        temporal_smoothing: share of the previous mask where the network is wholly undecided.
        half_size_from_px: frames whose shorter side is at least this long are segmented at half size. It takes a third
            of the time, and looks the same.
        guide_side_px: the guided filter works at a size whose shorter side has about this many pixels.
        guide_radius_px: radius of its window, at that size.
        guide_epsilon: its regularization. Steps of gray well above the root of it (0.045 of white) count as edges. With
            less the outline of dark hair before a dark room is grainy, with more it is wide (`python -m
            tests.rim_accuracy`).
        certain_background: mask value that counts as 0. Below it the network is hazy over clutter.
        certain_person: mask value that counts as 1. Above it the network doubts within the person.
    """

    landscape_aspect: float = 4 / 3
    temporal_smoothing: float = 0.9
    half_size_from_px: int = 480
    guide_side_px: int = 180
    guide_radius_px: int = 3
    guide_epsilon: float = 2e-3
    certain_background: float = 0.25
    certain_person: float = 0.85


TUNABLES = MattingTunables()


class SelfieMatting:
    """Matting by MediaPipe's selfie segmentation, smoothed over time and fitted to the edges of the frame.

    The networks give a mask 256 pixels wide, without single hairs, and leave out some objects held in the hand.
    """

    def __init__(self, options: SessionOptions | None = None, find_model: Callable[[str], Path] = model_path) -> None:
        """Find the models. Each is opened with the first frame that needs it.

        Args:
            options: how to run the networks.
            find_model: name of a model → its file.

        Raises:
            ModelError: a model is missing.
        """
        self._options = options
        self._files = {name: find_model(name) for name in (LANDSCAPE_MODEL, SQUARE_MODEL)}
        self._sessions: dict[str, Session] = {}
        self._size: tuple[int, int] | None = None
        self._previous: Mask | None = None

    def matte(self, frame: Frame) -> Alpha:
        """Alpha of the person, of the frame's size.

        Raises:
            ModelError: the network cannot be opened, or has other inputs or outputs than expected.
        """
        if frame.size != self._size:
            self.reset()
            self._size = frame.size
        image = halve(frame.image) if min(frame.size) >= TUNABLES.half_size_from_px else frame.image
        mask = smooth_over_time(self._segment(image), self._previous)
        self._previous = mask
        return refine_edges(mask, image, frame.size)

    def reset(self) -> None:
        """Forget the previous frame (after a cut, or with a new source)."""
        self._previous = None

    def _segment(self, image: DisplayImage) -> Mask:
        landscape = image.shape[1] >= TUNABLES.landscape_aspect * image.shape[0]
        session = self._session(LANDSCAPE_MODEL if landscape else SQUARE_MODEL)
        _, height, width, _ = session.inputs["image"].shape
        assert height is not None  # `_session` made sure of both
        assert width is not None
        while image.shape[0] >= 2 * height and image.shape[1] >= 2 * width:
            image = halve(image)
        stretched = cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR)
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
    """The mask with the previous one blended in where the network is undecided, both (height, width) in 0..1.

    The previous mask's share is s · 4m(1 - m), with s = `temporal_smoothing`: a pixel that is surely person or surely
    background follows at once, so no trail is left behind a moving person. After MediaPipe's
    SegmentationSmoothingCalculator, with the parabola in place of its polynomial of the entropy.
    """
    if previous is None:
        return mask
    share = (4 * TUNABLES.temporal_smoothing) * mask * (1 - mask)
    return mask + share * (previous - mask)


def refine_edges(mask: Mask, image: DisplayImage, size: tuple[int, int]) -> Alpha:
    """Alpha of `size` (width, height), from a coarser mask of the same scene, with the edges of its image.

    Fast guided filter (He and Sun 2015) with the gray image, which is no larger than `size`, as guide. Then the certain
    ends of the mask are stretched to 0 and 1. Only what is near the person is computed: beyond, alpha is 0.
    """
    height, width = image.shape[:2]
    shrink = max(1, round(min(height, width) / TUNABLES.guide_side_px))
    enlarged: Mask = cv2.resize(mask, (width, height), interpolation=cv2.INTER_LINEAR)
    near = _near_person(enlarged, shrink)
    alpha = np.zeros(size[::-1], np.uint8)
    if enlarged[near].size:
        guide = cv2.cvtColor(image[near], cv2.COLOR_RGB2GRAY)
        if image.shape[1::-1] == size:
            guide = cv2.medianBlur(guide, 3)  # what was not reduced has all of its noise, which would grain the edge
        fitted: Mask = cv2.ximgproc.guidedFilter(
            guide,
            enlarged[near],
            TUNABLES.guide_radius_px,  # at the shrunken size
            TUNABLES.guide_epsilon * 255**2,  # the guide is in 8 bits
            scale=1 / shrink,
        )
        low, high = TUNABLES.certain_background, TUNABLES.certain_person
        scale = 255 / (high - low)
        # Rounded, and clipped to 0..255.
        stretched = cv2.addWeighted(fitted, scale, fitted, 0, -low * scale, dtype=cv2.CV_8U)
        rows, columns = (
            slice(round(part.start * large / small), round(part.stop * large / small))
            for part, large, small in zip(near, size[::-1], (height, width), strict=True)
        )
        onto = alpha[rows, columns]
        cv2.resize(stretched, onto.shape[::-1], dst=onto, interpolation=cv2.INTER_LINEAR)
    return alpha


def _near_person(mask: Mask, shrink: int) -> tuple[slice, slice]:
    """Rows and columns outside of which the guided filter gives no alpha to speak of; empty where there is nobody.

    They begin and end at multiples of `shrink`, so that the shrunken pixels are those of the whole.
    """
    left, top, width, height = cv2.boundingRect(cv2.inRange(mask, 0.4 * TUNABLES.certain_background, np.inf))
    if width == 0:
        return slice(0, 0), slice(0, 0)
    reach = shrink * (2 * TUNABLES.guide_radius_px + 2)  # two windows, and what is interpolated
    sides = zip((top, left), (top + height, left + width), mask.shape, strict=True)
    rows, columns = (
        slice(max(start - reach, 0) // shrink * shrink, min(-(-(end + reach) // shrink) * shrink, side))
        for start, end, side in sides
    )
    return rows, columns


class RecordedMatting:
    """Matting that plays back recorded mattes by the frame's index, from the beginning again after the last one."""

    def __init__(self, path: Path) -> None:
        """Read what `write_mattes` wrote.

        Raises:
            InputError: the file is missing or holds no mattes.
        """
        try:
            self._alpha = read_mattes(path)
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror or error}", RECORDED_CURE) from error
        except UNREADABLE_MATTES as error:
            raise InputError(f"{path} holds no recorded mattes: {error}", RECORDED_CURE) from error

    def matte(self, frame: Frame) -> Alpha:
        """Alpha of the person, of the frame's size.

        For a frame of another shape the matte is scaled to cover it and cropped about its center.
        """
        alpha = self._alpha[frame.index % len(self._alpha)]
        return resize_to_fill(alpha, frame.size, cv2.INTER_LINEAR)
