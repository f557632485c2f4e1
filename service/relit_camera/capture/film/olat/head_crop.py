"""The square about head and shoulders that becomes the subject's picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.alignment.rigid_transform import RigidTransform, Size, warp_affine
from relit_camera.capture.film.face_circle import FaceCircle

_REACH_RADII = 2.0
"""Half the square's side, in radii of the face: hair above, shoulders below."""
_LOWER_RADII = 0.2
"""Distance of the square's middle below that of the face, in radii."""


@dataclass(frozen=True)
class HeadCrop:
    """A square in the reference frame of a film.

    Attributes:
        left, top, side: in pixels of the film.
        size: of the cropped pictures, pixels a side.
        picture: width and height of the film's pictures.
    """

    left: float
    top: float
    side: float
    size: int
    picture: Size

    @property
    def scale(self) -> float:
        """Pixels of a cropped picture per pixel of the film."""
        return self.size / self.side

    def crop(self, picture: NDArray[np.float32], transform: RigidTransform) -> NDArray[np.float32]:
        """The square (size, size, channels) of a frame (height, width, channels) aligned to the reference.

        Args:
            picture: the frame's picture.
            transform: from the frame to the reference.
        """
        supersampling = max(1, int(np.ceil(self.side / self.size - 1e-6)))
        factor = supersampling * self.scale
        matrix = transform.matrix(self.picture)
        matrix[:, 2] -= self.left, self.top
        fine = warp_affine(picture, matrix * factor, (supersampling * self.size, supersampling * self.size))
        if supersampling == 1:
            return fine
        return np.asarray(cv2.resize(fine, (self.size, self.size), interpolation=cv2.INTER_AREA), np.float32)

    def to_crop(self, x: float, y: float) -> tuple[float, float]:
        """Position in the cropped pictures of a point of the reference frame, both in pixels."""
        return (x - self.left) * self.scale, (y - self.top) * self.scale

    def disc(self, x: float, y: float, radius: float) -> NDArray[np.bool_]:
        """Mask (size, size) of a circle of the reference frame, given in pixels of the film."""
        x, y = self.to_crop(x, y)
        center = np.arange(self.size) + 0.5
        return np.asarray(np.hypot(center - x, center[:, None] - y) < radius * self.scale)


def place_head_crop(face: FaceCircle, picture: Size, size: int) -> HeadCrop:
    """The square about a face, inside the picture, with at most as many pixels as the film shows there.

    Args:
        face: in the reference frame.
        picture: width and height of the film's pictures.
        size: desired pixels a side.
    """
    side = min(2 * _REACH_RADII * face.radius, *picture)
    left, top = (
        float(np.clip(middle - side / 2, 0, length - side))
        for middle, length in zip((face.x, face.y + _LOWER_RADII * face.radius), picture, strict=True)
    )
    return HeadCrop(left, top, float(side), min(size, int(side)), picture)
