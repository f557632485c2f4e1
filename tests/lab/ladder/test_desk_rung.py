"""A known person as the simulation of desk recordings wants them."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.lab.evaluate.ladder.desk_rung import simulated_person
from tests.lab.ladder.known_head import PIXELS_PER_CM, head_samples, known_head


def test_the_simulated_person_has_the_known_field_and_the_heads_scale() -> None:
    simulated, samples = simulated_person(known_head()), head_samples()
    assert simulated.pixels_per_cm == pytest.approx(PIXELS_PER_CM, rel=0.03)
    pixels = np.flatnonzero(samples.matte.ravel() > 0.99)
    lit = np.flatnonzero(samples.directions[:, 2] > 0.5)
    found = simulated.field.at(samples.directions[lit], pixels)
    np.testing.assert_allclose(found, samples.pictures.reshape(len(samples.pictures), -1, 3)[lit][:, pixels], atol=0.02)
    assert simulated.field.size == samples.matte.shape
