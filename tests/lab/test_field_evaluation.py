"""A field's evaluation: the thesis's findings on a ball whose truth is a formula, and the report on them."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from relit_camera.base.errors import InputError, LightsError
from relit_camera.lab.evaluate.field.candidates import BLACK_RING_METHOD, method_candidates
from relit_camera.lab.evaluate.field.field_evaluation import FieldReport, evaluate_field
from relit_camera.lab.evaluate.field.field_report import field_json, field_page, field_text
from relit_camera.lab.evaluate.field.ghost_shadows import find_shadow_transitions, mid_tone_fraction
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth
from relit_camera.lab.evaluate.field.sample_points import SamplePoint, face_sample_points, parse_sample_point
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from tests.lab.html_outline import Outline
from tests.lab.lit_sphere import cap, grid, shadowed

METHODS = ["barycentric", "planar", "nearest", "sh3", BLACK_RING_METHOD]
"""Those that the findings are about, and one that smooths; test_candidates asks every installed one."""
SPOTS = [SamplePoint("beside the shadow", 20, 20), SamplePoint("middle", 24, 24)]


@pytest.fixture(scope="module")
def report() -> FieldReport:
    samples, truth = shadowed(cap(40, 60)), GroundTruth(shadowed(grid(16)))
    environments = {name: builtin_light_map(name) for name in ("studio", "party")}
    candidates = method_candidates(samples, truth.inside, METHODS)
    return evaluate_field(candidates, samples.directions, samples, truth, environments, SPOTS)


def by_name(report: FieldReport) -> dict[str, dict[str, float]]:
    figures: dict[str, dict[str, float]] = field_json(report)["candidates"]  # type: ignore[assignment]
    return figures


@pytest.mark.slow
def test_errors_are_at_the_sides(report: FieldReport) -> None:
    figures = by_name(report)
    assert figures["barycentric"]["sides_over_middle"] > 2
    profile = report.across(next(e for e in report.candidate_scores if e.name == "barycentric").error_whole)
    assert min(profile[2], profile[-3]) > 1.7 * profile[10:14].max()


@pytest.mark.slow
def test_what_was_not_sampled_dominates_and_the_ring_helps(report: FieldReport) -> None:
    figures = by_name(report)
    assert figures["barycentric"]["error_whole"] > 5 * figures["barycentric"]["error_in_region"]
    assert figures[BLACK_RING_METHOD]["error_whole"] < 0.8 * figures["barycentric"]["error_whole"]
    assert figures[BLACK_RING_METHOD]["error_in_region"] == pytest.approx(
        figures["barycentric"]["error_in_region"], rel=0.02
    )


def test_spherical_gains_over_planar_and_both_over_the_nearest(report: FieldReport) -> None:
    figures = by_name(report)
    for key in ("error_in_region", "error_whole"):
        assert figures["barycentric"][key] < figures["planar"][key]
    assert figures["planar"]["error_in_region"] < figures["nearest"]["error_in_region"]
    assert figures["barycentric"]["light_psnr_db"] > figures["planar"]["light_psnr_db"]


def test_interpolation_shows_ghosts_and_truth_does_not(report: FieldReport) -> None:
    figures = by_name(report)
    assert report.truth_mid_tones < 0.1
    assert figures["nearest"]["mid_tone_share"] < 0.15
    assert figures["barycentric"]["mid_tone_share"] > 0.4
    assert report.ghost is not None
    assert report.ghost.light in np.flatnonzero(report.in_region)


def test_a_half_way_mixture_is_all_mid_tone() -> None:
    samples, truth = shadowed(cap(40, 60)), GroundTruth(shadowed(grid(8)))
    lights = np.flatnonzero(truth.directions[:, 2] > 0.7)
    spots = find_shadow_transitions(samples, truth, lights)
    halves = np.zeros_like(truth.colors)
    for between in spots:
        halves[between.light, between.decided] = ((between.low + between.high) / 2)[:, None]
    assert sum(int(between.decided.sum()) for between in spots) > 20
    assert mid_tone_fraction(spots, halves) == 1
    assert mid_tone_fraction(spots, np.zeros_like(halves)) == 0


def test_perfect_prediction_has_no_error() -> None:
    samples, truth = shadowed(cap(40, 60), 16), GroundTruth(shadowed(grid(8), 16))
    perfect = method_candidates(truth.samples, truth.inside, ["barycentric"])
    report = evaluate_field(perfect, samples.directions, samples, truth, {}, [])
    assert float(report.candidate_scores[0].error_whole.max()) < 1e-9


def test_nothing_left_to_compare_is_an_error() -> None:
    samples = shadowed(cap(40, 60), 16)
    truth = GroundTruth(samples)
    candidates = method_candidates(samples, truth.inside, ["barycentric"])
    with pytest.raises(LightsError, match="nothing is left to compare"):
        evaluate_field(candidates, samples.directions, samples, truth, {}, [])


@pytest.mark.slow
def test_the_page_is_whole_in_itself_and_every_figure_has_a_caption(report: FieldReport) -> None:
    page = field_page(report, "Ball <&>")
    outline = Outline()
    outline.feed(page)
    assert outline.open == []
    assert outline.fetched == []
    assert not re.search(r"(?:https?:)?//|url\(|@import", re.sub(r"base64,[A-Za-z0-9+/=]+", "", page))
    assert outline.figures == outline.captions >= 10
    assert len(outline.images) >= 10
    smallest = min(float(each.error_whole.mean()) * 1e3 for each in report.candidate_scores)
    assert f"{smallest:.2f}" in outline.best
    assert "Ball &lt;&amp;&gt;" in page
    for each in report.candidate_scores:
        assert each.name in page
        assert each.name in field_text(report)


def test_the_figures_are_plain_json(report: FieldReport) -> None:
    figures = json.loads(json.dumps(field_json(report), allow_nan=False))
    assert set(figures["harmonics"]) == {"studio", "party"}
    kept = figures["harmonics"]["party"]
    assert kept["degree_2_psnr_db"] < kept["degree_8_psnr_db"]


def test_spots_without_landmarks_are_spread_over_the_person(report: FieldReport) -> None:
    matte = report.truth.samples.matte
    spots = face_sample_points({}, matte)
    assert len({(spot.x, spot.y) for spot in spots}) == 5
    assert all(matte[spot.y, spot.x] > 0.5 for spot in spots)


def test_a_spot_is_named_on_the_command_line(report: FieldReport) -> None:
    matte = report.truth.samples.matte
    assert parse_sample_point("ear=20,24", matte) == SamplePoint("ear", 20, 24)
    for wrong in ("ear", "=1,2", "ear=1", "ear=1.5,2", "ear=0,0", "ear=99,99"):
        with pytest.raises(InputError):
            parse_sample_point(wrong, matte)
