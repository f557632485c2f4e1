"""Sample points: pixels of the person whose reflectance maps are shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import Mask, Points

_FACE_POINTS = {
    "cheek": (280, 280, 0.0),
    "nose side": (49, 49, 0.0),
    "eye socket": (190, 190, 0.0),
    "temple": (139, 139, 0.0),
    "under the chin": (152, 17, 0.3),
}
"""Name → landmarks a and b of mesh478, and a factor f; the point is a + f (a - b)."""
_FALLBACK_POINTS = {
    "upper left": (0.3, 0.3),
    "upper right": (0.7, 0.3),
    "middle": (0.5, 0.5),
    "lower left": (0.3, 0.7),
    "lower right": (0.7, 0.7),
}
"""Name → place in the matte's box, where no landmarks are known."""


@dataclass(frozen=True)
class SamplePoint:
    """A named pixel: column x and row y."""

    name: str
    x: int
    y: int


def face_sample_points(landmarks: Mapping[str, Points], matte: Mask) -> list[SamplePoint]:
    """Cheek, side of the nose, eye socket, temple and the shaded skin under the chin, by landmarks of scheme mesh478.

    Without them, five spots spread over the person. All lie inside the matte.
    """
    points = landmarks.get("mesh478")
    if points is None:
        rows, columns = np.nonzero(matte > 0.5)
        corner, size = np.array([columns.min(), rows.min()]), np.array([np.ptp(columns), np.ptp(rows)])
        places = {name: corner + size * place for name, place in _FALLBACK_POINTS.items()}
    else:
        places = {name: points[a] + (points[a] - points[b]) * on for name, (a, b, on) in _FACE_POINTS.items()}
    return [_nearest_inside(name, float(x), float(y), matte) for name, (x, y) in places.items()]


def parse_sample_point(text: str, matte: Mask) -> SamplePoint:
    """Parse a sample point from `NAME=X,Y`.

    Raises:
        InputError: not in that form, or outside of the person.
    """
    name, _, place = text.partition("=")
    parts = place.split(",")
    if not name or len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise InputError(f"'{text}' names no pixel", "write NAME=X,Y with whole numbers")
    x, y = (int(part) for part in parts)
    if not (y < matte.shape[0] and x < matte.shape[1] and matte[y, x] > 0.5):
        raise InputError(f"pixel {x},{y} of '{name}' is not on the person", "choose one inside the matte")
    return SamplePoint(name, x, y)


def _nearest_inside(name: str, x: float, y: float, matte: Mask) -> SamplePoint:
    rows, columns = np.nonzero(matte > 0.5)
    nearest = int(np.argmin((columns + 0.5 - x) ** 2 + (rows + 0.5 - y) ** 2))
    return SamplePoint(name, int(columns[nearest]), int(rows[nearest]))
