"""A mug: its origin in the middle of the bottom, Y up, the handle at the picture's right."""

from __future__ import annotations

import numpy as np

from relit_studio.people.props.solids import Blob, Solid, revolve, union_surface

RADIUS_CM, HEIGHT_CM = 4.0, 9.5
RIM = np.array([0.0, HEIGHT_CM, -RADIUS_CM + 0.1])
"""Point of the rim that the lips touch."""

_PROFILE = (
    (0, 0.2), (2.9, 0.2), (3.1, 0), (3.5, 0.05), (3.78, 0.35), (3.92, 1.0), (4, 2), (4, 5), (4, 8.2), (4, 9.2),
    (3.97, 9.42), (3.86, 9.5), (3.74, 9.42), (3.7, 9.2), (3.66, 8), (3.66, 5), (3.66, 2), (3.5, 1.1), (3, 0.8),
    (0, 0.75),
)  # fmt: skip
_HANDLE = np.array(
    [
        [3.8, 7.7, 0, 0.55], [5.0, 7.8, 0, 0.5], [6.2, 7.3, 0, 0.5], [6.8, 6.2, 0, 0.5], [6.8, 4.9, 0, 0.5],
        [6.3, 3.6, 0, 0.5], [5.2, 2.7, 0, 0.5], [3.8, 2.3, 0, 0.55],
    ]
)  # fmt: skip


def throw_mug() -> tuple[Solid, Solid]:
    """Body and handle of the mug; the ends of the handle lie inside the wall."""
    return revolve(_PROFILE, 64), union_surface([Blob((_HANDLE,), 0.2)], 0.2, 0.2)
