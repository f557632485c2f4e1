"""The square about head and shoulders that becomes the subject's picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.alignment.rigid_transform import RigidTransform, Size, warp_affine
from relit_camera.capture.film.face_circle import FaceCircle

_REACH = 2.0
"""Half the square's side, in radii of the face: hair above, shoulders below."""
_LOWER = 0.2
"""How far its middle is below the face's, in radii."""


@dataclass(frozen=True)
class HeadCrop:
    """A square in the reference frame.

    Attributes:
        left, top, side: in pixels of the video.
        size: of the pictures cut, pixels a side.
        picture: width and height of the video.
    """

    left: float
    top: float
    side: float
    size: int
    picture: Size

    @property
    def scale(self) -> float:
        """Pixels of a cut picture a pixel of the video."""
        return self.size / self.side

    def cut(self, picture: NDArray[np.float32], transform: RigidTransform) -> NDArray[np.float32]:
        """What the square holds, (size, size, channels), of a frame (height, width, channels) taken to the reference.

        Args:
            picture: the frame's.
            transform: from the frame to the reference.
        """
        finer = max(1, int(np.ceil(self.side / self.size - 1e-6)))
        factor = finer * self.scale
        matrix = transform.matrix(self.picture)
        matrix[:, 2] -= self.left, self.top
        fine = warp_affine(picture, matrix * factor, (finer * self.size, finer * self.size))
        if finer == 1:
            return fine
        return np.asarray(cv2.resize(fine, (self.size, self.size), interpolation=cv2.INTER_AREA), np.float32)

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Where a point of the reference frame, in pixels of the video, is in the cut pictures."""
        return (x - self.left) * self.scale, (y - self.top) * self.scale


def place_head_crop(face: FaceCircle, picture: Size, size: int) -> HeadCrop:
    """The square about a face in a picture (width, height), inside of it, at most as many pixels as the video has.

    Args:
        face: in the reference frame.
        picture: width and height of the video.
        size: pixels a side that are wanted; fewer if the video shows fewer.
    """
    side = min(2 * _REACH * face.radius, *picture)
    left, top = (
        float(np.clip(middle - side / 2, 0, length - side))
        for middle, length in zip((face.x, face.y + _LOWER * face.radius), picture, strict=True)
    )
    return HeadCrop(left, top, float(side), min(size, int(side)), picture)
