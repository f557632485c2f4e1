"""A few pictures of a fixed scene, small enough to be kept: what the ball is looked for in."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import linear_from_uint8, luminance, uint8_from_linear
from relit_camera.base.images.image_types import LinearImage, check_image

MAX_FRAMES = 48
"""More show nothing new: two dozen flashes from all sides, and as many dark frames."""
MAX_SIDE = 1280
"""Pixels along the longer side; a ball's outline is found to a fraction of one."""


@dataclass(frozen=True, eq=False)
class SceneSample:
    """Pictures of one scene from one place, in the order they came.

    Attributes:
        codes: uint8 (count, height, width), luminance as sRGB codes.
        scale: pixels of these pictures a pixel of the original.
        size: width and height of the original.
    """

    codes: NDArray[np.uint8]
    scale: float
    size: tuple[int, int]

    def luminance(self, index: int) -> NDArray[np.float32]:
        """Linear luminance (height, width) of one of them."""
        return linear_from_uint8(self.codes[index])

    def averages(self, count: int) -> NDArray[np.float32]:
        """Linear luminance (at most count, height, width): means over the darkest pictures, the next, and so on."""
        order = np.argsort(self.codes.mean(axis=(1, 2)), kind="stable")
        groups = np.array_split(order, min(count, len(order)))
        return np.stack([np.mean([self.luminance(index) for index in group], axis=0) for group in groups])


class SceneSampler:
    """Keeps at most `MAX_FRAMES` of a stream of frames, every one with the same chance.

    By chance and not at a fixed step, which might meet a flashing light always in the same state. The choice is the
    same each time (reservoir sampling: Vitter 1985, algorithm R).
    """

    def __init__(self) -> None:
        self._chance = np.random.default_rng(0)
        self._kept: list[tuple[int, NDArray[np.uint8]]] = []
        self._size, self._scale, self._seen = (0, 0), 1.0, 0

    def add(self, frame: LinearImage) -> None:
        """Take a frame, linear RGB (height, width, 3) float32.

        Raises:
            CaptureError: it is not as large as those before.
            ImageError: it is no such picture.
        """
        check_image(frame, np.float32, "frame")
        size = (frame.shape[1], frame.shape[0])
        index, self._seen = self._seen, self._seen + 1
        if index == 0:
            self._size, self._scale = size, min(1.0, MAX_SIDE / max(size))
        if size != self._size:
            sizes = f"{size[0]}x{size[1]} instead of {self._size[0]}x{self._size[1]}"
            raise CaptureError(f"frame {index} is {sizes}", "give frames of one size")
        place = index if index < MAX_FRAMES else int(self._chance.integers(index + 1))
        if place < MAX_FRAMES:
            self._kept[place : place + 1] = [(index, uint8_from_linear(self._resized(luminance(frame))))]

    def sample(self) -> SceneSample:
        """What was kept.

        Raises:
            CaptureError: there was no frame.
        """
        if not self._kept:
            raise CaptureError("there is no frame to look for a mirror ball in", "give at least one")
        codes = [codes for _, codes in sorted(self._kept, key=lambda pair: pair[0])]
        return SceneSample(np.stack(codes), self._scale, self._size)

    def _resized(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        if self._scale == 1:
            return image
        size = [max(1, round(side * self._scale)) for side in self._size]
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def sample_scene(frames: Iterable[LinearImage]) -> SceneSample:
    """Keep some frames of a stream.

    Raises:
        CaptureError: there is none, or they differ in size.
        ImageError: one is no linear RGB picture.
    """
    sampler = SceneSampler()
    for frame in frames:
        sampler.add(frame)
    return sampler.sample()
