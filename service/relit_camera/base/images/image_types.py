"""Image types and their checks.

Inside the program a picture is float32 linear RGB (height, width, 3), scene-referred. At the program's edges (sources,
sinks, files) it is uint8 sRGB, channel order RGB; BGR exists only inside the code that reads and writes those. Points
are (x, y) in pixels with pixel centers at integers + ½; a flow is backward: out(x) = in(x + flow(x)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ImageError

LinearImage = NDArray[np.float32]
"""(height, width, 3) float32 linear RGB, scene-referred."""

DisplayImage = NDArray[np.uint8]
"""(height, width, 3) uint8 sRGB, channel order RGB."""

Mask = NDArray[np.float32]
"""(height, width) float32 in 0..1."""

Alpha = NDArray[np.uint8]
"""(height, width) uint8: 0 clear, 255 opaque, between them shares of linear light."""

RgbaImage = NDArray[np.uint8]
"""(height, width, 4) uint8: sRGB and alpha, straight: the colors do not hold the factor alpha."""

Points = NDArray[np.float32]
"""(count, 2) float32 pixel positions (x, y), pixel centers at integers + ½."""

Flow = NDArray[np.float32]
"""(height, width, 2) float32 backward flow (dx, dy) in pixels: out(x) = in(x + flow(x))."""

Box = tuple[int, int, int, int]
"""Left, top, right and bottom of a part of a picture, in pixels or cells."""


@dataclass(frozen=True)
class Frame:
    """One picture from a source.

    Attributes:
        image: uint8 sRGB RGB (height, width, 3); must not be written to.
        index: counts from 0 in the order in which the source delivered the frames.
        captured_at: seconds on the monotonic clock when it was received: latency is measured from here.
        time_s: seconds on the source's own clock (presentation time of a file; since the start for a camera).
    """

    image: DisplayImage
    index: int
    captured_at: float
    time_s: float

    def __post_init__(self) -> None:
        check_image(self.image, np.uint8, "frame")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.image.shape[1], self.image.shape[0]


def check_image(image: NDArray, dtype: type, name: str, channels: int = 3) -> None:
    """Check that `image` is (height, width, channels) of `dtype`.

    Raises:
        ImageError: it is not; the message has both shapes.
    """
    if image.ndim != 3 or image.shape[2] != channels or image.dtype != dtype or 0 in image.shape:
        expected = f"(height, width, {channels}) {np.dtype(dtype).name}"
        raise ImageError(f"{name} has shape {image.shape} {image.dtype}, not {expected}")
