"""Folded shirt collar: it stands around the neck and folds down to two points."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.easing import smoothstep
from relit_studio.people.geometry import find_nearest, unit

_OPENING = (0.03, 0.42)
"""Half the opening angle at the front, at the fold and at the edge, radians."""
_COLUMNS = 72
_THICK_CM = 0.12
_PROFILE = np.array(
    [
        (-0.2, -1.2), (-0.25, 0.0), (-0.2, 0.6), (-0.05, 1.0), (0.2, 1.05), (0.5, 0.6), (0.85, -0.1), (1.15, -0.8),
        (1.4, -1.3),
    ]
)  # fmt: skip
"""Cross section: outward and upward offsets from the neckline, from inside over the fold to the edge, centimeters."""
_POINT_CM = 1.3
"""How far the two points reach below the edge."""


def fold_collar(neckline: Float64Array, up: Float64Array, cloth: Float64Array) -> tuple[Float64Array, Indices]:
    """Vertices (n, 3) and faces (m, 4) about a neckline (k, 3) in a plane whose normal is `up`, over cloth (l, 3)."""
    center = neckline.mean(axis=0)
    offset = neckline - center
    angle = np.arctan2(offset[:, 0], offset[:, 2])
    order = np.argsort(angle)
    rows = []
    for index, (out, high) in enumerate(_PROFILE):
        falls = float(smoothstep(index, 4, len(_PROFILE) - 1))
        opening = _OPENING[0] + (_OPENING[1] - _OPENING[0]) * falls
        around = np.linspace(opening, 2 * np.pi - opening, _COLUMNS)
        ring = np.stack(
            [np.interp(around, angle[order], neckline[order, axis], period=2 * np.pi) for axis in range(3)], axis=1
        )
        outward = unit((ring - center) - ((ring - center) @ up)[:, None] * up)
        pointed = np.exp(-(((np.minimum(around, 2 * np.pi - around) - opening) / 0.25) ** 2))
        # At the front it lies flatter and ends in points.
        row = ring + outward * (out + 0.4 * falls * pointed)[:, None] + up * high
        rows.append(row - np.outer(_POINT_CM * falls * pointed, [0, 1, 0]) - 0.3 * pointed[:, None] * up * (1 - falls))
    sheet = _above(np.stack(rows), cloth)
    return _thickened(sheet)


def _above(sheet: Float64Array, cloth: Float64Array) -> Float64Array:
    """A sheet (r, c, 3) whose falling half is kept outside the cloth."""
    flat = sheet.reshape(-1, 3).copy()
    tree = cKDTree(cloth)
    falling = np.repeat(np.arange(len(sheet)) >= 5, sheet.shape[1])
    for _ in range(4):
        distance, nearest = find_nearest(tree, flat, 6)
        near = cloth[nearest].mean(axis=1)
        outward = unit((near - [0, -14, -2]) * [0.6, 1, 1])
        gap = ((flat - near) * outward).sum(axis=1)
        push = np.where(falling & (distance[:, 0] < 3), np.clip(0.3 - gap, 0, None), 0)
        flat = flat + push[:, None] * outward
    return flat.reshape(sheet.shape)


def _thickened(sheet: Float64Array) -> tuple[Float64Array, Indices]:
    """Both sides of a sheet (r, c, 3) and its rim."""
    r, c = sheet.shape[:2]
    normal = unit(np.cross(np.gradient(sheet, axis=1), np.gradient(sheet, axis=0)))
    vertices = np.concatenate(
        [(sheet + _THICK_CM / 2 * normal).reshape(-1, 3), (sheet - _THICK_CM / 2 * normal).reshape(-1, 3)]
    )
    index = np.arange(r * c).reshape(r, c)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    rim = np.concatenate([index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]])
    following = np.roll(rim, -1)
    edge = np.stack([rim, rim + r * c, following + r * c, following], axis=1)
    return vertices, np.concatenate([quads[:, ::-1], quads + r * c, edge])
