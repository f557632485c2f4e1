"""Fitting the network of the learned desk field, on faces that are made up and on one who is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from relit_camera.capture.desk.person.learned_field import learned_network
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.ladder.known_person import SubjectFolder, known_person
from relit_studio.field.learned_response import field_fit
from relit_studio.field.learned_response.field_fit import field_error, fit_field_network
from relit_studio.field.learned_response.known_field import known_field
from relit_studio.field.learned_response.training_lights import training_lights
from tests.studio.field.learned_response.made_up_field import QUICK_FIELD, made_up_field


def test_the_slope_is_that_of_the_error() -> None:
    face = made_up_field(0)
    face = replace(face, measured=face.measured.astype(np.float64), painted=face.painted.astype(np.float64))
    weight = field_fit._weights(face, QUICK_FIELD)
    given: Any = np.random.default_rng(1).normal(0, 0.1, (400, 10))
    _, slope = field_fit._error(given, face, weight, QUICK_FIELD)
    for pixel, output in ((0, 0), (7, 3), (20, 9), (350, 9)):
        step = np.zeros_like(given)
        step[pixel, output] = 1e-4
        errors = [field_fit._error(given + sign * step, face, weight, QUICK_FIELD)[0] for sign in (1, -1)]
        assert slope[pixel, output] == pytest.approx((errors[0] - errors[1]) / 2e-4, rel=0.02, abs=1e-8)


@pytest.mark.slow
def test_it_learns_which_answer_to_believe_and_what_to_add() -> None:
    network = fit_field_network([made_up_field(seed) for seed in range(4)], QUICK_FIELD)
    unseen = made_up_field(9)
    assert field_error(None, unseen, QUICK_FIELD) > 0.2
    assert field_error(network, unseen, QUICK_FIELD) < 0.3 * field_error(None, unseen, QUICK_FIELD)
    above, below = (network.outputs(np.eye(1, 23, 1, dtype=np.float32) * sign)[0, -1] for sign in (2, -2))
    assert above < -0.4 < 0.4 < below


@pytest.mark.study
@pytest.mark.usefixtures("models")
def test_a_person_before_a_screen_and_the_truth_lie_over_each_other(bundled_person: OlatSamples) -> None:
    """Were they apart by some pixels, or lit otherwise, the measured field would be wrong by far more."""
    person = known_person("adam", bundled_person, 128, SubjectFolder(None))
    known = known_field(person, "desk", training_lights(24), 30.0)
    assert len(known.inputs) > 2000
    assert 0.7 < np.median(known.brightness) < 1.1
    assert 0.05 < field_error(None, known) < 0.2
    # The lightest skin is that of which the measured field is nearly right.
    assert field_error(learned_network(), known) < 1.1 * field_error(None, known)
