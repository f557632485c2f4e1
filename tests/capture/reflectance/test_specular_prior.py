"""The specular prior: highlights that a pixel's own pictures cannot tell are its neighbours'."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.reflectance.appearance_model import TUNABLES, SpecularEstimate, specular_prior

SIZE = 40


def test_what_is_told_well_counts_and_what_is_far_does_not() -> None:
    matte = np.ones((SIZE, SIZE), np.float32)
    matte[:, -4:] = 0
    inside = np.flatnonzero(matte.ravel())
    column = inside % SIZE
    left = column < SIZE // 2
    amounts = np.where(left, 0.4, 0.1)[:, None] * np.ones((1, 2), np.float32)
    precision = np.full((len(inside), 2), 1e4, np.float32)
    # Every second pixel knows nothing, and has nonsense.
    amounts[::2], precision[::2] = 9.0, 0.0
    found = specular_prior(SpecularEstimate(amounts.astype(np.float32), precision), inside, matte)
    far = TUNABLES.prior_reach * SIZE * 2.5
    np.testing.assert_allclose(found.amounts[column < SIZE / 2 - far], 0.4, rtol=0.05)
    np.testing.assert_allclose(found.amounts[column > SIZE / 2 + far], 0.1, rtol=0.2)
    assert (found.precision > 0).all()


def test_a_person_without_any_highlight_has_finite_ones() -> None:
    matte = np.ones((8, 8), np.float32)
    found = specular_prior(SpecularEstimate(*np.zeros((2, 64, 2), np.float32)), np.arange(64), matte)
    assert np.isfinite(found.precision).all()
    np.testing.assert_array_equal(found.amounts, 0)
