"""A sample of a film's frames in which the mirror ball is looked for, and the edges common to these frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import linear_from_uint8, luminance, uint8_from_linear
from relit_camera.base.images.image_types import LinearImage, check_image

Plane = NDArray[np.float32]

MAX_FRAMES = 48
"""Frames kept: two dozen flashes from all sides and as many dark frames; more show nothing new."""
MAX_SIDE = 1280
"""Pixels along the longer side of what is kept; a ball's outline is found to a fraction of one."""


@dataclass(frozen=True)
class EdgeTunables:
    """How edges are weighed; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        blur_px: standard deviation of the Gaussian before gradients are taken.
        level_window_px: side of the window whose brightest pixel a gradient is divided by.
        black: luminance below which differences are noise.
        half_contrast: change of brightness a pixel, relative to the brightness, at which an edge counts half.
    """

    blur_px: float = 1.0
    level_window_px: int = 7
    black: float = 0.003
    half_contrast: float = 0.04


_EDGES = EdgeTunables()


@dataclass(frozen=True, eq=False)
class FrameSample:
    """Pictures of one scene from one camera position, in the order of the film.

    Attributes:
        codes: uint8 (count, height, width), luminance as sRGB codes.
        scale: size of these pictures relative to the original.
        size: width and height of the original.
    """

    codes: NDArray[np.uint8]
    scale: float
    size: tuple[int, int]

    def luminance(self, index: int) -> NDArray[np.float32]:
        """Linear luminance (height, width) of one picture."""
        return linear_from_uint8(self.codes[index])

    def averages(self, count: int) -> NDArray[np.float32]:
        """Linear luminance (at most count, height, width): means of the darkest pictures, of the next, and so on."""
        order = np.argsort(self.codes.mean(axis=(1, 2)), kind="stable")
        groups = np.array_split(order, min(count, len(order)))
        return np.stack([np.mean([self.luminance(index) for index in group], axis=0) for group in groups])


class FrameSampler:
    """Reservoir sampling of at most `MAX_FRAMES` of a stream of frames (Vitter 1985, algorithm R).

    Every frame is kept with the same probability: a fixed step might meet a flashing light always in the same state.
    The random choice is seeded, so the sample is the same each time.
    """

    def __init__(self) -> None:
        self._chance = np.random.default_rng(0)
        self._kept: list[tuple[int, NDArray[np.uint8]]] = []
        self._size, self._scale, self._seen = (0, 0), 1.0, 0

    def add(self, frame: LinearImage) -> None:
        """Take the next frame, linear RGB (height, width, 3) float32.

        Raises:
            CaptureError: it differs in size from the frames before.
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

    def sample(self) -> FrameSample:
        """The frames that were kept.

        Raises:
            CaptureError: there was none.
        """
        if not self._kept:
            raise CaptureError("there is no frame to look for a mirror ball in", "give at least one")
        codes = [codes for _, codes in sorted(self._kept, key=lambda pair: pair[0])]
        return FrameSample(np.stack(codes), self._scale, self._size)

    def _resized(self, image: NDArray[np.float32]) -> NDArray[np.float32]:
        if self._scale == 1:
            return image
        size = [max(1, round(side * self._scale)) for side in self._size]
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def sample_frames(frames: Iterable[LinearImage]) -> FrameSample:
    """Sample a stream of linear RGB frames (height, width, 3) float32; see `FrameSampler`.

    Raises:
        CaptureError: there is none, or they differ in size.
        ImageError: one is no linear RGB picture.
    """
    sampler = FrameSampler()
    for frame in frames:
        sampler.add(frame)
    return sampler.sample()


@dataclass(frozen=True, eq=False)
class EdgeMap:
    """Edges that stay in place while the light moves: the structure tensor, averaged over the pictures of a scene.

    An edge counts whether it is brighter or darker than its surroundings, as a ball's limb is by turns when the light
    moves. Gradients are taken in linear light, where blur does not shift an edge, relative to the local brightness;
    each counts between 0 and 1.

    Attributes:
        xx, xy, yy: float32 (height, width), components of the tensor.
    """

    xx: Plane
    xy: Plane
    yy: Plane

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.xx.shape[1], self.xx.shape[0]

    def reduced(self, factor: float) -> EdgeMap:
        """The edges of the same picture with `factor` (at most 1) times as many pixels along each side."""
        size = (max(1, round(self.size[0] * factor)), max(1, round(self.size[1] * factor)))
        return EdgeMap(*(cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (self.xx, self.xy, self.yy)))

    def lines(self) -> tuple[Plane, Plane]:
        """Thinned edges: strength 0..1 (height, width), nonzero on ridges only, and unit normal (height, width, 2)."""
        angle = 0.5 * np.arctan2(2 * self.xy, self.xx - self.yy)
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        strength = self.xx + self.yy
        rows, columns = np.indices(strength.shape, dtype=np.float32)
        sides = [
            cv2.remap(strength, columns + sign * normal[..., 0], rows + sign * normal[..., 1], cv2.INTER_LINEAR)
            for sign in (-1, 1)
        ]
        return np.where((strength >= sides[0]) & (strength >= sides[1]), strength, np.float32(0)), normal

    def along(self, x: NDArray, y: NDArray, angle: NDArray) -> Plane:
        """Strength 0..1 of edges perpendicular to the direction `angle` (radians, from x toward y) at pixels x, y.

        All arrays have one shape (h, w).
        """
        parts = [
            cv2.remap(part, (x - 0.5).astype(np.float32), (y - 0.5).astype(np.float32), cv2.INTER_LINEAR)
            for part in (self.xx, self.xy, self.yy)
        ]
        cos, sin = np.cos(angle), np.sin(angle)
        return np.asarray(cos * cos * parts[0] + 2 * cos * sin * parts[1] + sin * sin * parts[2], np.float32)


def edge_map(sample: FrameSample) -> EdgeMap:
    """Edges that the pictures of a sample have in common."""
    xx, xy, yy = (np.zeros(sample.codes.shape[1:], np.float32) for _ in range(3))
    window = np.ones((_EDGES.level_window_px, _EDGES.level_window_px), np.uint8)
    for index in range(len(sample.codes)):
        light = cv2.GaussianBlur(sample.luminance(index), (0, 0), _EDGES.blur_px)
        level = cv2.dilate(light, window) + np.float32(_EDGES.black)
        dx, dy = cv2.Scharr(light, cv2.CV_32F, 1, 0) / 32 / level, cv2.Scharr(light, cv2.CV_32F, 0, 1) / 32 / level
        clear = 1 / (dx * dx + dy * dy + np.float32(_EDGES.half_contrast**2))
        xx += dx * dx * clear
        xy += dx * dy * clear
        yy += dy * dy * clear
    count = np.float32(len(sample.codes))
    return EdgeMap(xx / count, xy / count, yy / count)
