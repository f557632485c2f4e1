"""Face detection with YuNet (Wu et al. 2023), through OpenCV."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.face.detection.face_detector import Detection, FaceDetector, reduced

_SURROUNDINGS_PX = 128
_LOG_ERRORS = 2


class YuNetDetector(FaceDetector):
    """YuNet on the picture scaled so that its longer side is `longer_side`."""

    def __init__(self, model: Path, longer_side: int = 320, threshold: float = 0.7) -> None:
        """Open the model.

        Raises:
            ModelError: the file is missing or is no YuNet model.
        """
        if not model.is_file():
            raise ModelError(f"face detector {model} does not exist", "get it with `relit models pull`")
        try:
            with _quiet_opencv():
                self._network = cv2.FaceDetectorYN.create(str(model), "", (longer_side, longer_side), threshold)
        except cv2.error as error:
            raise ModelError(f"face detector {model} is damaged", "get it again with `relit models pull`") from error
        self._longer_side = longer_side

    def _faces(self, image: DisplayImage) -> list[Detection]:
        return self._found(image, self._longer_side)

    def _faces_in_surroundings(self, region: DisplayImage) -> list[Detection]:
        return self._found(region, _SURROUNDINGS_PX)

    def _found(self, image: DisplayImage, longer_side: int) -> list[Detection]:
        height, width = image.shape[:2]
        small = reduced(image, longer_side)
        rows, columns = small.shape[:2]
        self._network.setInputSize((columns, rows))
        found = self._network.detect(cv2.cvtColor(small, cv2.COLOR_RGB2BGR))[1]
        if found is None:
            return []
        return [_detection(row, width / columns, height / rows) for row in found]


@contextmanager
def _quiet_opencv() -> Iterator[None]:
    # OpenCV 5 warns about its graph engine, which is not used here; it also moved these functions.
    logging = getattr(cv2.utils, "logging", cv2)
    level = logging.getLogLevel()
    logging.setLogLevel(_LOG_ERRORS)
    try:
        yield
    finally:
        logging.setLogLevel(level)


def _detection(row: NDArray[np.float32], scale_x: float, scale_y: float) -> Detection:
    scaled = row[:14].reshape(7, 2) * [scale_x, scale_y]
    box = (float(scaled[0, 0]), float(scaled[0, 1]), float(scaled[1, 0]), float(scaled[1, 1]))
    return Detection(box, scaled[2:4].astype(np.float32), float(row[14]))
