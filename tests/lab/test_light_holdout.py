"""Leaving lights out."""

from __future__ import annotations

import json

import numpy as np
import pytest

from relit_camera.base.errors import ConfigError, LightsError
from relit_camera.capture.reflectance.method_registry import method_names
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import boundary_lights
from relit_camera.lab.evaluate.field.candidates import BLACK_RING_METHOD
from relit_camera.lab.evaluate.field.ground_truth import select_lights
from relit_camera.lab.evaluate.light_holdout import (
    aligned_truth,
    evaluate_hold_out,
    holdout_json,
    holdout_page,
    holdout_text,
    interior_lights,
    parse_hold_out,
)
from tests.lab.lit_sphere import cap, lambert

METHODS = ["barycentric", "planar", "visibility", "rbf", "nearest"]


@pytest.mark.slow
def test_only_surrounded_lights_are_left_out() -> None:
    samples = lambert(cap(120, 50))
    assert set(interior_lights(samples.directions)) | set(boundary_lights(samples.directions)) == set(
        range(len(samples.directions))
    )
    result = evaluate_hold_out("ball", samples, 4, ["barycentric"])
    rim = range(len(samples.directions) - 16, len(samples.directions))
    assert not set(result.left_out) & set(rim)
    assert len(result.left_out) == -(-(len(samples.directions) - 16) // 4)


@pytest.mark.slow
def test_more_left_out_is_harder_and_the_nearest_light_is_worst() -> None:
    samples = lambert(cap(120, 60))
    few, many = (evaluate_hold_out("ball", samples, every, METHODS) for every in (4, 2))
    scores = {score.method: score for score in few.scores}
    assert few.scores[-1].method == "nearest"
    assert scores["barycentric"].peak_255_db > scores["nearest"].peak_255_db + 3
    harder = {score.method: score for score in many.scores}
    # 16 pixels are too few to be aligned well, and these lie right as they are.
    assert harder["barycentric"].raw_peak_255_db < scores["barycentric"].raw_peak_255_db


@pytest.mark.slow
def test_the_figure_is_the_error_at_peak_one() -> None:
    samples = lambert(cap(120, 50))
    result = evaluate_hold_out("ball", samples, 4, ["nearest"])
    inside = samples.matte > 0.5
    kept = np.setdiff1d(np.arange(len(samples.directions)), result.left_out)
    errors = []
    for light in result.left_out:
        nearest = kept[(samples.directions[kept] @ samples.directions[light]).argmax()]
        errors.append(np.mean((samples.pictures[nearest][inside] - samples.pictures[light][inside]) ** 2))
    assert result.scores[0].raw_peak_255_db == pytest.approx(np.mean(-10 * np.log10(errors)), abs=1e-3)


@pytest.mark.slow
def test_flashes_of_varying_strength_and_small_motions_are_undone_by_one_transform_for_all() -> None:
    samples = lambert(cap(70, 60), 40)
    gains = np.random.default_rng(3).uniform(0.8, 1.25, len(samples.directions)).astype(np.float32)
    uneven = samples.pictures * gains[:, None, None, None]
    result = evaluate_hold_out(
        "ball", OlatSamples(uneven, samples.directions, samples.matte), 4, ["barycentric", "nearest"]
    )
    even = evaluate_hold_out("ball", samples, 4, ["barycentric", "nearest"])
    for found, best in zip(result.scores, even.scores, strict=True):
        assert found.method == best.method
        assert found.peak_255_db == pytest.approx(best.peak_255_db, abs=0.7)
        assert found.raw_peak_255_db < found.peak_255_db - 5 or found.method == "nearest"


def test_the_gain_is_that_of_the_strobe_and_not_of_a_method_that_is_too_dark() -> None:
    """All strobes are equally strong; interpolation between lights 20 degrees apart is 2 % too dark."""
    samples = lambert(cap(60, 60), 48)
    left_out = interior_lights(samples.directions)[::2]
    kept = select_lights(samples, np.setdiff1d(np.arange(len(samples.directions)), left_out))
    truth = samples.pictures[left_out]
    found = aligned_truth(kept, truth, samples.directions[left_out])
    np.testing.assert_allclose(found.sum(axis=(1, 2, 3)) / truth.sum(axis=(1, 2, 3)), 1, atol=0.015)


@pytest.mark.slow
def test_pictures_that_no_light_could_make_are_neither_used_nor_asked_for() -> None:
    samples = lambert(cap(70, 60), 40)
    pictures = samples.pictures.copy()
    pictures[[0, 4]] = 0
    result = evaluate_hold_out("ball", OlatSamples(pictures, samples.directions, samples.matte), 4, ["barycentric"])
    assert set(result.rejected) == {0, 4}
    assert not {0, 4} & set(result.left_out)
    assert "picture 4 rejected" in holdout_text([result])


@pytest.mark.slow
def test_the_ring_is_compared_where_it_is_asked_for_and_only_there() -> None:
    samples = lambert(cap(60, 50))
    assert [score.method for score in evaluate_hold_out("ball", samples, 4, [BLACK_RING_METHOD]).scores] == [
        BLACK_RING_METHOD
    ]
    assert {score.method for score in evaluate_hold_out("ball", samples, 4).scores} == set(method_names())


def test_no_surrounded_light_is_an_error() -> None:
    rim = cap(120, 50)[-16:]
    with pytest.raises(LightsError):
        evaluate_hold_out("rim", lambert(rim), 4)


@pytest.mark.parametrize("wrong", ["4", "every", "every=1", "every=x", "each=4", "every=-2"])
def test_a_wrong_hold_out_is_one_clear_error(wrong: str) -> None:
    assert parse_hold_out("every=4") == 4
    with pytest.raises(ConfigError, match="every=N"):
        parse_hold_out(wrong)


@pytest.mark.slow
def test_reports_hold_every_list_and_method() -> None:
    results = [evaluate_hold_out(name, lambert(cap(60, 50)), 2, METHODS) for name in ("a.lp", "b.lp")]
    page, text, figures = holdout_page(results), holdout_text(results), json.loads(json.dumps(holdout_json(results)))
    for name in ("a.lp", "b.lp", "planar", "nearest", "barycentric"):
        assert name in page
        assert name in text
    mean = figures["mean_peak_255_db"]["planar"]["every_2"]
    of_lists = [figures["lists"][n]["every_2"]["methods"]["planar"]["peak_255_db"] for n in ("a.lp", "b.lp")]
    assert mean == pytest.approx(np.mean(of_lists))
