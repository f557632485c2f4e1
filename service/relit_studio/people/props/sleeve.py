"""A sleeve: its origin at the wrist, Y along the forearm to the elbow."""

from __future__ import annotations

import numpy as np

from relit_studio.people.props.solids import Solid, revolve

_LENGTH_CM = 34.0
_CUFF = ((0, 2.2), (2.6, 2.0), (3.05, 0.9), (3.3, 0.75), (3.5, 0.95))
"""The cuff from inside round its edge, radius and place along the arm."""


def sew_sleeve() -> Solid:
    """A sleeve with a few folds, wider toward the elbow."""
    along = np.linspace(1.6, _LENGTH_CM, 60)
    folds = 0.13 * np.sin(2.1 * along) * np.sin(0.37 * along + 1) + 0.1 * np.sin(0.9 * along + 2)
    radius = 3.5 + 2.0 * (along / _LENGTH_CM) ** 0.8 + folds * np.clip((along - 2) / 4, 0, 1)
    sleeve = revolve([*_CUFF, *zip(radius, along, strict=True), (0, _LENGTH_CM + 1)])
    # Folds run round at a slant.
    x, y, z = sleeve.vertices.T
    slanted = sleeve.vertices + np.stack([0 * x, 0.25 * x * np.clip((y - 2) / 4, 0, 1), 0 * z], axis=1)
    return Solid(slanted, sleeve.faces)
