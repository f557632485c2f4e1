"""Fitting the network of the learned response, on people who are made up and on one who is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from relit_camera.base.errors import CaptureError, InputError
from relit_camera.capture.desk.person import learned_field
from relit_camera.capture.instant.response.learned_response import input_signs, learned_network
from relit_camera.capture.instant.response.response_network import harmonic_signs, read_network
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import fibonacci_directions, texel_directions
from relit_camera.light.spherical_harmonics import basis
from relit_studio.__main__ import app
from relit_studio.commands import learn
from relit_studio.field.learned_response import response_fit
from relit_studio.field.learned_response.field_fit import fit_field_network
from relit_studio.field.learned_response.known_field import KnownField
from relit_studio.field.learned_response.known_response import KnownResponse, known_response
from relit_studio.field.learned_response.network_training import TrainingSettings
from relit_studio.field.learned_response.response_fit import FitSettings, fit_response_network, response_error
from relit_studio.field.learned_response.training_lights import training_lights
from tests.studio.field.learned_response.made_up_field import QUICK_FIELD, made_up_field

LAMP_DEG = 30.0
QUICK = FitSettings(TrainingSettings(hidden=(16,), rounds=150, jitter=0.0), pixels=400)


def made_up(seed: int, brightness: float = 1.0, tilt: float = 0.3) -> KnownResponse:
    """A person to whose generic response something is added that depends on the place to the right."""
    rng = np.random.default_rng(seed)
    toward = fibonacci_directions(48)
    lamps = fibonacci_directions(12)
    weights = np.exp(4 * (toward @ lamps.T - 1))
    inputs = np.zeros((400, len(input_signs())), np.float32)
    inputs[:, 0] = rng.normal(0, 1, 400)
    expected = (np.abs(rng.normal(1, 0.1, (400, 1))) * (1 + toward[:, 2])) @ weights
    harmonics = weights.T @ basis(toward, 2)
    added = np.zeros((400, 9))
    added[:, 1] = tilt * np.tanh(inputs[:, 0])
    skin = (np.arange(400) < 300).astype(np.float32)
    truth = np.log((expected + added @ harmonics.T) * np.where(skin, brightness, rng.uniform(0.2, 2, 400))[:, None])
    as_floats = (np.asarray(each, np.float32) for each in (expected, truth, skin, harmonics))
    return KnownResponse(inputs, *as_floats)


def test_lights_are_rooms_of_the_same_strength() -> None:
    lights = training_lights(6)
    assert lights.shape == (2048, 6)
    assert lights.min() > 0
    np.testing.assert_allclose(lights.sum(axis=0), 4, rtol=1e-4)
    assert (texel_directions().reshape(-1, 3)[:, 1] @ lights).mean() > 0.2


def test_the_mirrored_person_has_left_and_right_changed() -> None:
    toward = fibonacci_directions(9)
    mirrored = basis(toward * (-1, 1, 1), 2)
    np.testing.assert_allclose(mirrored, basis(toward, 2) * harmonic_signs(), atol=1e-9)
    assert input_signs()[:3].tolist() == [-1, 1, 1]


def test_the_slope_is_that_of_the_error() -> None:
    person = made_up(0)
    weight = response_fit._weights(person, QUICK)
    given: Any = np.random.default_rng(1).normal(0, 0.05, (400, 9))
    person = replace(person, expected=person.expected.astype(np.float64))
    _, slope = response_fit._error(given, person, weight, QUICK)
    for pixel, harmonic in ((0, 0), (7, 3), (350, 8)):
        step = np.zeros_like(given)
        step[pixel, harmonic] = 1e-4
        errors = [response_fit._error(given + sign * step, person, weight, QUICK)[0] for sign in (1, -1)]
        assert slope[pixel, harmonic] == pytest.approx((errors[0] - errors[1]) / 2e-4, rel=0.02, abs=1e-8)


def test_what_people_have_in_common_is_found_whatever_their_albedo() -> None:
    people = [made_up(seed) for seed in range(4)]
    unseen = made_up(9)
    network = fit_response_network(people, QUICK)
    assert response_error(None, unseen, QUICK) > 0.03
    assert response_error(network, unseen, QUICK) < 0.3 * response_error(None, unseen, QUICK)
    left, right = (network.outputs(np.eye(1, len(input_signs()), dtype=np.float32) * sign)[0, 1] for sign in (-1, 1))
    assert left == pytest.approx(-right, abs=0.06)


def test_skin_that_is_brighter_in_all_light_is_expected_half_so() -> None:
    person = made_up(3, brightness=1.1, tilt=0.0)
    network = fit_response_network([person], replace(QUICK, training=replace(QUICK.training, small=0.0)))
    gained = network.outputs(person.inputs) @ person.harmonics.T / person.expected
    assert gained[person.skin > 0].mean() == pytest.approx(0.1 * QUICK.believed, abs=0.02)


@pytest.mark.slow
@pytest.mark.usefixtures("models")
def test_a_person_who_was_not_learned_from_answers_as_learned(bundled_person: OlatSamples) -> None:
    person = known_response(bundled_person, training_lights(24), LAMP_DEG)
    generic, learned = response_error(None, person), response_error(learned_network(), person)
    assert 0.05 < generic < 0.25
    assert learned < 0.95 * generic


@pytest.mark.slow
@pytest.mark.usefixtures("models")
def test_the_command_learns_and_says_how_well(
    bundled_person: OlatSamples, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def people(path: Path) -> OlatSamples:
        if path.parent.name == "7":
            nobody = np.zeros_like(bundled_person.pictures)
            return replace(bundled_person, pictures=nobody)
        return bundled_person

    monkeypatch.setattr(learn, "_render", lambda *arguments: None)
    monkeypatch.setattr(learn, "import_samples", people)

    def fields(name: str, *more: object) -> list[KnownField]:
        if name == "6":
            raise CaptureError("nobody", "leave them out")
        return [made_up_field(0)]

    monkeypatch.setattr(learn, "_known_fields", fields)
    monkeypatch.setattr(learn, "fit_response_network", lambda known: fit_response_network(known, QUICK))
    monkeypatch.setattr(learn, "fit_field_network", lambda known: fit_field_network(known, QUICK_FIELD))
    found = CliRunner().invoke(app, ["learn", "--out", str(tmp_path), "--first", "5", "--people", "3"])
    assert found.exit_code == 0, found.output
    assert "7 is left out: no face was found" in found.output
    assert "6 before screens is left out: nobody" in found.output
    assert "instant, 5, held out: error" in found.output
    assert "desk, all 2, trained on: error" in found.output
    response = read_network(tmp_path / learn.RESPONSE, input_signs(), harmonic_signs())
    field = read_network(tmp_path / learn.FIELD, learned_field.input_signs(), learned_field.output_signs())
    assert response.layers[-1][1].shape == (9,)
    assert field.layers[-1][1].shape == (10,)
    few = CliRunner().invoke(app, ["learn", "--out", str(tmp_path), "--first", "6", "--people", "2"])
    assert isinstance(few.exception, InputError)
