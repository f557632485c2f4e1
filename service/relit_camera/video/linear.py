"""Reading video files for measuring: linear light, as exactly as the file tells it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.space.colour import Gamma, decode
from relit_camera.space.images import LinearImage
from relit_camera.video.decoding import CodeConverter, white_code
from relit_camera.video.pictures import PictureReader


@dataclass(frozen=True)
class LinearFrame:
    """One picture of a video file.

    Attributes:
        image: (height, width, 3) float32 linear RGB; the file's white is 1.
        index: counts from 0 in the order of presentation.
        time_s: presentation time from the first frame, seconds; grows strictly, also where the rate varies.
    """

    image: LinearImage
    index: int
    time_s: float


class LinearReader(PictureReader[LinearFrame]):
    """The frames of a video file as linear light, upright, in order of presentation. Iterate once; open again at will.

    A file of 10 or 12 bits is converted in 16, so that nothing of it is lost.

    Raises:
        VideoError: as `VideoReader`.
    """

    def __init__(
        self,
        path: Path,
        gamma: Gamma = "srgb",
        *,
        longer_side: int | None = None,
        only: Collection[int] | None = None,
        threads: int = 1,
    ) -> None:
        """Open a file.

        Args:
            path: the file.
            gamma: curve of its code values.
            longer_side: scale down so that the longer side has so many pixels, while colours are converted: cheap.
                Code values are averaged, not light.
            only: indices of the frames to give; all if None.
            threads: of the decoder.
        """
        self._gamma, self._longer_side = gamma, longer_side
        self._convert: CodeConverter | None = None
        self._table: NDArray[np.float32] = np.zeros(0, np.float32)
        super().__init__(path, threads, only)

    def _make(self, picture: Any, index: int, time_s: float) -> LinearFrame:
        if self._convert is None:
            deep = any(component.bits > 8 for component in picture.format.components)
            self._convert = CodeConverter(pixels="rgb48le" if deep else "rgb24", longer_side=self._longer_side)
            values = np.arange(65536 if deep else 256, dtype=np.float32) / np.float32(white_code(picture, deep))
            self._table = decode(np.minimum(values, 1), self._gamma)
        codes = np.ascontiguousarray(self._turn.upright(self._convert(picture)))
        image = self._table[codes] if codes.dtype == np.uint16 else cv2.LUT(codes, self._table)
        return LinearFrame(np.asarray(image, np.float32), index, time_s)
