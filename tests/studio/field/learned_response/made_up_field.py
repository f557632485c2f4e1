"""A face before a screen whose two answers and truth are made up."""

from __future__ import annotations

import numpy as np

from relit_camera.capture.desk.person.learned_field import input_signs
from relit_camera.light.directions import fibonacci_directions
from relit_camera.light.spherical_harmonics import basis
from relit_studio.field.learned_response.field_fit import FieldFitSettings
from relit_studio.field.learned_response.known_field import KnownField
from relit_studio.field.learned_response.network_training import TrainingSettings

QUICK_FIELD = FieldFitSettings(TrainingSettings(hidden=(16,), rounds=300, jitter=0.0), pixels=400)


def made_up_field(seed: int, tilt: float = 0.3) -> KnownField:
    """Where the second input is above 0 the painted head is right, elsewhere the measured field, up to a tilt.

    The tilt is an amount of the harmonic that is odd across the picture, and grows with the first input, which is the
    place to the right.
    """
    rng = np.random.default_rng(seed)
    toward = fibonacci_directions(48)
    weights = np.exp(4 * (toward @ fibonacci_directions(12).T - 1))
    inputs = np.zeros((400, len(input_signs())))
    inputs[:, :2] = rng.normal(0, 1, (400, 2))
    inputs[:, 20] = rng.normal(0, 1, 400)
    measured, painted = ((1 + toward @ axis) @ weights * np.ones((400, 1)) for axis in ((0, 0, 1), (0, 1, 0)))
    harmonics = weights.T @ basis(toward, 2)
    added = np.zeros((400, 9))
    added[:, 1] = tilt * np.tanh(inputs[:, 0])
    truth = np.where(inputs[:, 1:2] > 0, painted, measured) + added @ harmonics.T
    parts = inputs, measured, painted, np.log(truth), np.ones(400), harmonics
    return KnownField(*(np.asarray(each, np.float32) for each in parts))
