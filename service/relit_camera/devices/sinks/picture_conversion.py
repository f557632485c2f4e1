"""Pictures in the layout that virtual cameras take, made once for all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import rgb_to_i420
from relit_camera.base.images.image_types import DisplayImage


class I420Converter:
    """Converts pictures to I420. The same picture again, for another camera or repeated, is not converted again.

    Pictures are never modified once they are shown, so the same object is the same picture. Of one thread.
    """

    def __init__(self) -> None:
        self._image: DisplayImage | None = None
        self._planes: NDArray[np.uint8] = np.empty(0, np.uint8)

    def __call__(self, image: DisplayImage) -> NDArray[np.uint8]:
        """`rgb_to_i420` of a picture, uint8 sRGB RGB with even width and height."""
        if image is not self._image:
            self._planes = rgb_to_i420(image)
            self._image = image
        return self._planes
