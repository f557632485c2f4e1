"""What a face detector gives, and what all of them share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.base.images.image_types import DisplayImage, Points

Box = tuple[float, float, float, float]
"""x, y, width, height in pixels."""

_SAME_FACE_OVERLAP = 0.1
_SURROUNDINGS = 2.5
"""Side of the surroundings of a face, in sides of its box."""
_SMALLEST_REGION_PX = 8


@dataclass(frozen=True, eq=False)
class Detection:
    """A detected face: accurate enough to start and check landmarks, too coarse and unsteady for more.

    Attributes:
        box: around the face, from the brows to the chin.
        eyes: (2, 2) centre of the subject's right and left eye in pixels; wrong from about 45° of roll.
        score: 0..1.
    """

    box: Box
    eyes: Points
    score: float

    def moved(self, x: float, y: float) -> Detection:
        """The detection in a picture in which it lies further right and down by x and y pixels."""
        left, top, width, height = self.box
        return Detection((left + x, top + y, width, height), self.eyes + np.array([x, y], np.float32), self.score)


class FaceDetector(ABC):
    """Finds faces in a picture. Not thread-safe."""

    def detect(self, image: DisplayImage, near: Box | None = None, besides: Sequence[Box] = ()) -> Detection | None:
        """Find the face that overlaps `near` most, or else the largest; None where there is none besides some others.

        Args:
            image: the picture.
            near: where one is expected.
            besides: faces that are not wanted.
        """
        faces = [face for face in self._faces(image) if not any(is_same_face(face.box, each) for each in besides)]
        return max(faces, key=lambda face: _detection_priority(face.box, near)) if faces else None

    def detect_all(self, image: DisplayImage) -> list[Detection]:
        """Find every face of a picture."""
        return self._faces(image)

    def detect_nearby(self, image: DisplayImage, box: Box) -> Detection | None:
        """Find the largest face in the surroundings of `box` alone: a quick check of a face that is there already."""
        x, y, width, height = box
        half = _SURROUNDINGS * max(width, height) / 2
        center_x, center_y = x + width / 2, y + height / 2
        left, top = max(round(center_x - half), 0), max(round(center_y - half), 0)
        region = image[top : max(round(center_y + half), 0), left : max(round(center_x + half), 0)]
        if min(region.shape[:2]) < _SMALLEST_REGION_PX:
            return None
        faces = self._faces_in_surroundings(region)
        return max((face.moved(left, top) for face in faces), key=lambda face: face.box[2] * face.box[3], default=None)

    @abstractmethod
    def _faces(self, image: DisplayImage) -> list[Detection]:
        """All faces in a picture."""

    @abstractmethod
    def _faces_in_surroundings(self, region: DisplayImage) -> list[Detection]:
        """All faces in the surroundings of one, quickly."""


def reduced(image: DisplayImage, longer_side: int) -> DisplayImage:
    """Scale a picture so that its longer side has so many pixels."""
    height, width = image.shape[:2]
    scale = longer_side / max(width, height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    # Averaging over areas that are no whole pixels takes ten times as long as the sampling before it.
    if scale < 0.5:
        image = cv2.resize(image, (2 * size[0], 2 * size[1]), interpolation=cv2.INTER_LINEAR)
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    return np.asarray(small, dtype=np.uint8)


def intersection_over_union(first: Box, second: Box) -> float:
    """Intersection over union of two boxes, 0..1."""
    width = min(first[0] + first[2], second[0] + second[2]) - max(first[0], second[0])
    height = min(first[1] + first[3], second[1] + second[3]) - max(first[1], second[1])
    shared = max(width, 0.0) * max(height, 0.0)
    union = first[2] * first[3] + second[2] * second[3] - shared
    return shared / union if union > 0 else 0.0


def is_same_face(first: Box, second: Box) -> bool:
    """Whether two boxes overlap enough to be one face that moved a little."""
    return intersection_over_union(first, second) > _SAME_FACE_OVERLAP


def _detection_priority(box: Box, near: Box | None) -> tuple[float, float]:
    shared = intersection_over_union(box, near) if near else 0.0
    return (shared if shared > _SAME_FACE_OVERLAP else 0.0), box[2] * box[3]
