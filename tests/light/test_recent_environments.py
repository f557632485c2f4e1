"""Which environments are kept in memory, how large they are there, and how exact."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from relit_camera.light.environments.environment_panorama import Environment, Panorama, environment_from_panorama
from relit_camera.light.environments.recent_environments import RecentEnvironments

pytestmark = pytest.mark.slow

HEIGHT = 32
PACKED_BYTES = HEIGHT * 2 * HEIGHT * 3 * 2


def environment(seed: int = 0) -> Environment:
    """Light over fourteen orders of magnitude."""
    powers = np.random.default_rng(seed).uniform(-5, 9, (HEIGHT, 2 * HEIGHT, 3))
    return environment_from_panorama(f"room {seed}", Panorama((10**powers).astype(np.float32), 0.1, ("a note",)))


def test_one_in_use_is_given_again_and_another_one_afterwards() -> None:
    recent, made = RecentEnvironments(1 << 20), list[int]()

    def make() -> Environment:
        made.append(1)
        return environment()

    held = recent.get("room", make)
    assert recent.get("room", make) is held
    del held
    gc.collect()
    again, expected = recent.get("room", make), environment()
    assert made == [1]
    assert (again.name, again.notes, again.panorama.notes) == (expected.name, expected.notes, ("a note",))
    assert again.panorama.clipped_fraction == 0.1
    assert again.panorama.radiance.dtype == np.float32
    np.testing.assert_array_equal(again.light_map, expected.light_map)
    seen = expected.panorama.radiance > 1e-9 * expected.panorama.radiance.max()
    np.testing.assert_allclose(again.panorama.radiance[seen], expected.panorama.radiance[seen], rtol=5e-4)


def test_the_last_ones_are_kept_in_half_their_bytes() -> None:
    recent, made = RecentEnvironments(2 * PACKED_BYTES), list[int]()

    def get(seed: int) -> None:
        def make() -> Environment:
            made.append(seed)
            return environment(seed)

        recent.get(seed, make)
        gc.collect()
        assert recent.nbytes <= 2 * PACKED_BYTES

    for seed in (0, 1, 0, 2, 0, 1):
        get(seed)
    assert made == [0, 1, 2, 1]
    recent.most_bytes = 1
    get(3)
    get(3)
    assert made == [0, 1, 2, 1, 3]  # the last one, however large it is
    assert recent.nbytes == PACKED_BYTES


def test_what_is_forgotten_takes_no_memory() -> None:
    recent = RecentEnvironments(1 << 20)
    for seed in range(3):
        recent.get(seed, lambda seed=seed: environment(seed))  # type: ignore[misc]
    recent.forget(lambda key: key != 1)
    assert recent.nbytes == PACKED_BYTES
