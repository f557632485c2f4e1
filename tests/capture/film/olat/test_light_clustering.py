"""Pictures under nearly the same light merged."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.film.olat.light_clustering import (
    cluster_lights,
    merge_pictures,
    subsample_cluster,
    subsample_evenly,
)
from relit_camera.light.directions import direction_from_degrees


def spread(azimuth: float, elevation: float, count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(0)
    return direction_from_degrees(rng.uniform(-azimuth, azimuth, count), rng.uniform(-elevation, elevation, count))


def test_groups_are_close_and_not_too_many() -> None:
    directions = spread(50, 40, 400)
    groups = cluster_lights(directions, most=90)
    assert len(groups) <= 90
    assert sorted(np.concatenate(groups)) == list(range(400))
    few = cluster_lights(directions[:5])
    assert len(few) == 5


def test_near_duplicates_are_merged_and_outliers_weigh_little() -> None:
    rng = np.random.default_rng(0)
    truth = rng.uniform(0.2, 0.8, (10, 12, 3)).astype(np.float32)
    pictures = truth + rng.normal(0, 0.01, (5, 10, 12, 3)).astype(np.float32)
    pictures[2, 3:6] += 0.6
    found = merge_pictures(pictures, np.ones(5))
    assert np.abs(found - truth).max() < 0.035
    weighed = merge_pictures(np.stack([truth, truth + 1]).astype(np.float32), np.array([3.0, 1.0]))
    np.testing.assert_allclose(weighed, truth + 0.25, atol=1e-5)


def test_of_a_large_cluster_some_are_merged() -> None:
    assert subsample_cluster(np.arange(10, 110, 2)).tolist() == [10, 22, 34, 46, 58, 72, 84, 96, 108]
    assert subsample_cluster(np.array([4, 7])).tolist() == [4, 7]


def test_of_a_long_film_lights_from_all_directions_are_kept() -> None:
    directions = np.concatenate([spread(50, 40, 300), direction_from_degrees(np.linspace(60, 61, 500), 0.0)])
    kept = subsample_evenly(directions, 150)
    assert len(kept) <= 150
    assert np.all(np.diff(kept) > 0)
    assert np.degrees(np.arccos(np.clip((directions @ directions[kept].T).max(axis=1), -1, 1))).max() < 12
    np.testing.assert_array_equal(subsample_evenly(directions[:90], 150), np.arange(90))
