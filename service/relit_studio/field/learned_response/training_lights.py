"""Light of random rooms, in which the answers of heads are compared."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import LUMINANCE
from relit_camera.light.directions import direction_from_degrees, texel_directions, texel_solid_angles

SEED = 5


def training_lights(count: int, seed: int = SEED) -> NDArray[np.float32]:
    """Luminance times solid angle (2048, count) of rooms: even light, and one to three soft lamps in it.

    Most lamps are before and above the person; each room's light sums to 4.
    """
    rng = np.random.default_rng(seed)
    lights = np.stack([_room(rng) for _ in range(count)], axis=1)
    return np.asarray(4 * lights / lights.sum(axis=0), np.float32)


def _room(rng: np.random.Generator) -> NDArray[np.float64]:
    toward = texel_directions().reshape(-1, 3)
    radiance = np.full(len(toward), 0.05 + 0.4 * rng.random())
    for _ in range(rng.integers(1, 4)):
        lamp = direction_from_degrees(rng.normal(0, 70), np.clip(rng.normal(20, 30), -90, 90))
        sharpness = np.exp(rng.uniform(np.log(2), np.log(40)))
        power = sharpness / 4 * np.exp(rng.normal(0, 0.6)) * (rng.uniform(0.75, 1.25, 3) @ np.asarray(LUMINANCE))
        radiance += power * np.exp(sharpness * (toward @ lamp - 1))
    return np.asarray(radiance * texel_solid_angles().ravel())
