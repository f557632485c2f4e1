"""A highlight fitted as a disc that is visible in part."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.film.ball.specular_highlight import fit_occluded_disc

RADIUS = 4.0
AREA = np.pi * RADIUS**2


def disc(x: float, y: float) -> np.ndarray:
    rows, columns = np.mgrid[:40, :50] + 0.5
    return np.hypot(columns - x, rows - y) < RADIUS


def beside_band(top: int, bottom: int) -> np.ndarray:
    known = np.ones((40, 50), bool)
    known[top:bottom] = False
    return known


@pytest.mark.parametrize(("x", "y"), [(25.0, 20.0), (24.3, 19.6), (22.5, 22.6)])
def test_a_lamp_behind_a_bright_tube(x: float, y: float) -> None:
    known = beside_band(20, 23)
    lit = disc(x, y) & known
    found = fit_occluded_disc(lit, known, AREA)
    assert found is not None
    off = float(np.hypot(found[0] - x, found[1] - y))
    rows, columns = np.nonzero(lit)
    as_seen = float(np.hypot(columns.mean() + 0.5 - x, rows.mean() + 0.5 - y))
    assert off < 0.5
    assert off < 0.6 * as_seen


def test_a_disc_that_is_mostly_hidden_is_refused() -> None:
    known = beside_band(10, 24)
    assert fit_occluded_disc(disc(25, 20) & known, known, AREA) is None


def test_a_shape_that_is_no_disc_is_refused() -> None:
    lit = np.zeros((40, 50), bool)
    lit[18:20, 5:45] = True
    assert fit_occluded_disc(lit, np.ones_like(lit), AREA) is None


def test_a_disc_larger_than_the_picture() -> None:
    assert fit_occluded_disc(np.ones((10, 10), bool), np.ones((10, 10), bool), AREA) is None
