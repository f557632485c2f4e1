"""Lights beyond frontal ones, on shapes whose field is a formula."""

from __future__ import annotations

import json

import numpy as np
import pytest

from relit_camera.base.errors import LightsError, ModelError
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.face.face_state import Tracker
from relit_camera.lab.evaluate.ladder.frontal_lights import (
    PREDICTORS,
    FrontalResult,
    FrontalSet,
    evaluate_frontal,
    split_frontal,
)
from relit_camera.lab.evaluate.ladder.frontal_report import frontal_json, frontal_page, frontal_text
from relit_camera.light.directions import direction_from_degrees, fibonacci_directions
from relit_camera.subject.reflectance_field import TEXELS, texel_vectors
from tests.capture.instant.lit_person import SKIN, generic_person, person
from tests.lab.html_outline import Outline
from tests.lab.lit_sphere import lambert


def no_models() -> Tracker:
    raise ModelError("model 'mesh' is missing", "pull it")


def ball(size: int = 24, lights: int = 300) -> OlatSamples:
    return lambert(fibonacci_directions(lights), size)


@pytest.fixture(scope="module")
def result() -> FrontalResult:
    return evaluate_frontal(split_frontal("ball", ball(), no_models, 24))


def test_frontal_lights_are_known_and_those_beside_them_asked_for() -> None:
    angles = [(0, 0), (30, 21), (-30, 0), (0, -21), (31, 0), (0, 22), (90, 0), (150, 0)]
    directions = np.array([direction_from_degrees(*each) for each in angles])
    known = split_frontal("ball", lambert(directions, 16), no_models, 16)
    np.testing.assert_allclose(known.captured.directions, directions[:4])
    np.testing.assert_allclose(known.asked, directions[4:7])
    with pytest.raises(LightsError, match="no lights beside frontal ones"):
        split_frontal("ball", lambert(directions[:4], 16), no_models, 16)


def test_a_model_of_appearance_knows_a_matt_ball_from_the_front(result: FrontalResult) -> None:
    mean = {name: score.light_db.mean() for name, score in result.scores.items() if not score.failure}
    assert mean["model"] > mean["nearest light"] + 10 > mean["frontal picture"] + 10
    assert mean["blend"] > mean["nearest light"] + 10


def test_the_figure_is_the_error_with_one_gain_a_light(result: FrontalResult) -> None:
    light = int(np.argmax(result.from_side))
    samples = ball()
    inside = samples.matte > 0.5
    front = samples.pictures[samples.directions[:, 2].argmax()][inside].ravel().astype(float)
    truth = result.truth[light][inside].ravel().astype(float)
    gain = front @ truth / (front @ front)
    error = np.mean((gain * front - truth) ** 2)
    assert result.scores["frontal picture"].light_db[light] == pytest.approx(-10 * np.log10(error), abs=1e-3)


def test_without_a_face_the_other_predictors_still_count(result: FrontalResult) -> None:
    assert list(result.scores) == list(PREDICTORS)
    assert result.scores["generic head"].failure == "model 'mesh' is missing; pull it"
    figures = json.loads(json.dumps(frontal_json([result]), allow_nan=False))
    assert figures["ball"]["predictors"]["generic head"]["psnr_db"] is None
    assert figures["ball"]["predictors"]["model"]["from_side_db"] > 20
    assert "generic head: model 'mesh' is missing" in frontal_text([result])
    outline = Outline()
    outline.feed(frontal_page([result]))
    assert outline.fetched == outline.open == []
    assert len(outline.images) == 1


def test_a_person_who_answers_as_learned_is_known_by_instant() -> None:
    shape, _, matte = generic_person()
    _, response = person()
    texels = np.array([TEXELS // 2 + 31, *range(5, TEXELS, 400)])
    rows = np.zeros((len(texels), matte.size, 3), np.float32)
    rows[:, response.pixels] = response.diffuse[:, texels].T[..., None] * SKIN + response.glossy[:, texels].T[..., None]
    pictures, toward = rows.reshape(len(texels), *matte.shape, 3), texel_vectors()[texels].astype(np.float64)
    known = FrontalSet("person", OlatSamples(pictures[:1], toward[:1], matte), toward[1:], pictures[1:], no_models)
    vars(known)["head"] = shape
    inside = shape.skin
    errors = {
        name: np.abs(PREDICTORS[name](known)[:, inside] - pictures[1:, inside]).mean()
        for name in ("instant", "generic head")
    }
    assert errors["instant"] < 0.1 * pictures[1:, inside].mean()
    assert errors["instant"] < 0.6 * errors["generic head"]
