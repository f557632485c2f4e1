"""A live picture with the matte of the person in it, and both of them smaller."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2

from relit_camera.base.images.image_types import Alpha, DisplayImage
from relit_camera.base.images.resize import halve


@dataclass(frozen=True)
class MattedFrame:
    """A live picture and where the person is in it.

    Attributes:
        image: uint8 sRGB (height, width, 3).
        matte: alpha of the person, of the image's size.
    """

    image: DisplayImage
    matte: Alpha

    @cached_property
    def half(self) -> MattedFrame:
        """Both at half their size, rounded down: the means of four codes."""
        return MattedFrame(halve(self.image), halve(self.matte))

    def quarter(self) -> MattedFrame:
        """Both at a quarter of their size, rounded down: one pixel in four of each, which costs less than `half`."""
        height, width = self.matte.shape
        size = (max(width // 4, 1), max(height // 4, 1))
        image, matte = (cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in (self.image, self.matte))
        return MattedFrame(image, matte)
