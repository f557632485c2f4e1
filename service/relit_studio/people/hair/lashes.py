"""Eyelashes along the face model's lash strips, so that they follow every blink."""

from __future__ import annotations

import numpy as np

from relit_camera.base.array_types import Float64Array, Indices
from relit_studio.people.face.face_model import FaceModel, Part
from relit_studio.people.hair.hair_strands import Hairs, concatenate_hairs

_ROWS, _COLUMNS = 6, 19
"""A strip is a grid from root to tip, along the lid; an eye has three on the upper lid and three on the lower."""


def grow_lashes(model: FaceModel, vertices: Float64Array, seed: int, amount: float = 1.0) -> Hairs:
    """Lashes on a head in any expression; `amount` is a factor on their number."""
    rng = np.random.default_rng(seed + 300)
    along = np.linspace(0, 1, _ROWS)
    grown = []
    for part in (Part.LASHES_LEFT, Part.LASHES_RIGHT):
        for index, strip in enumerate(_strips(model, part)):
            upper = index < 3
            count = int((48 if upper else 20) * amount)
            place = np.sort(rng.uniform(0.6, _COLUMNS - 1.6, count))
            left = place.astype(int)
            fraction = (place - left)[:, None, None]
            grid = vertices[strip].transpose(1, 0, 2)
            points = grid[left] * (1 - fraction) + grid[left + 1] * fraction
            length = rng.uniform(0.55, 0.95, count) * (0.9 if upper else 0.8)
            points = points[:, :1] + (points - points[:, :1]) * length[:, None, None]
            # The strips point at the camera, which would hide the lashes, so they are curled.
            points[:, :, 0] += rng.normal(size=(count, 1)) * 0.06 * along**2
            points[:, :, 1] += (0.30 if upper else -0.10) * length[:, None] * along**1.6
            points[:, :, 2] -= (0.12 if upper else 0.0) * length[:, None] * along**2
            thick = np.full((count, _ROWS), 0.0085 if upper else 0.0055) * np.linspace(1, 0.25, _ROWS)
            grown.append(Hairs(points, thick, np.zeros(count)))
    return concatenate_hairs(grown)


def _strips(model: FaceModel, part: Part) -> Indices:
    """Vertices (6 strips, 6 rows, 19 columns) of one eye: upper strips first, roots where v is highest."""
    chosen = model.face_part == part
    indices, first = np.unique(model.faces[chosen], return_index=True)
    uv = model.uv[model.face_uv[chosen].ravel()[first]]
    order = np.lexsort((uv[:, 0], -uv[:, 1].round(3)))
    return np.asarray(indices[order].reshape(6, _ROWS, _COLUMNS), np.intp)
