"""A field's evaluation: the thesis's findings on a ball whose truth is a formula, and the report on them."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from relit_camera.errors import InputError, LightsError
from relit_camera.evaluate.candidates import RING, method_candidates
from relit_camera.evaluate.field import FieldReport, evaluate_field
from relit_camera.evaluate.field_page import field_json, field_page, field_text
from relit_camera.evaluate.ghosts import mid_tone_share, spots_between
from relit_camera.evaluate.points import Spot, face_spots, parse_spot
from relit_camera.evaluate.truth import Truth
from relit_camera.light.builtin.catalogue import builtin_environment
from tests.evaluate.ball import cap, grid, shadowed
from tests.evaluate.outline import Outline

SPOTS = [Spot("beside the shadow", 20, 20), Spot("middle", 24, 24)]


@pytest.fixture(scope="module")
def report() -> FieldReport:
    samples, truth = shadowed(cap(40, 60)), Truth(shadowed(grid(16)))
    environments = {name: builtin_environment(name).light_map for name in ("studio", "party")}
    candidates = method_candidates(samples, truth.inside)
    return evaluate_field(candidates, samples.directions, samples, truth, environments, SPOTS)


def by_name(report: FieldReport) -> dict[str, dict[str, float]]:
    figures: dict[str, dict[str, float]] = field_json(report)["candidates"]  # type: ignore[assignment]
    return figures


def test_errors_are_at_the_sides(report: FieldReport) -> None:
    figures = by_name(report)
    assert figures["barycentric"]["sides_over_middle"] > 2
    profile = report.across(next(e for e in report.judged if e.name == "barycentric").error_whole)
    assert min(profile[2], profile[-3]) > 1.7 * profile[10:14].max()


def test_what_was_not_sampled_dominates_and_the_ring_helps(report: FieldReport) -> None:
    figures = by_name(report)
    assert figures["barycentric"]["error_whole"] > 5 * figures["barycentric"]["error_in_region"]
    assert figures[RING]["error_whole"] < 0.8 * figures["barycentric"]["error_whole"]
    assert figures[RING]["error_in_region"] == pytest.approx(figures["barycentric"]["error_in_region"], rel=0.02)


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
    samples, truth = shadowed(cap(40, 60)), Truth(shadowed(grid(8)))
    lights = np.flatnonzero(truth.directions[:, 2] > 0.7)
    spots = spots_between(samples, truth, lights)
    halves = np.zeros_like(truth.colours)
    for between in spots:
        halves[between.light, between.decided] = ((between.low + between.high) / 2)[:, None]
    assert sum(int(between.decided.sum()) for between in spots) > 20
    assert mid_tone_share(spots, halves) == 1
    assert mid_tone_share(spots, np.zeros_like(halves)) == 0


def test_perfect_prediction_has_no_error() -> None:
    samples, truth = shadowed(cap(40, 60), 16), Truth(shadowed(grid(8), 16))
    perfect = method_candidates(truth.samples, truth.inside, ["barycentric"])
    report = evaluate_field(perfect, samples.directions, samples, truth, {}, [])
    assert float(report.judged[0].error_whole.max()) < 1e-9


def test_nothing_left_to_compare_is_an_error() -> None:
    samples = shadowed(cap(40, 60), 16)
    truth = Truth(samples)
    candidates = method_candidates(samples, truth.inside)
    with pytest.raises(LightsError, match="nothing is left to compare"):
        evaluate_field(candidates, samples.directions, samples, truth, {}, [])


def test_the_page_is_whole_in_itself_and_every_figure_has_a_caption(report: FieldReport) -> None:
    page = field_page(report, "Ball <&>")
    outline = Outline()
    outline.feed(page)
    assert outline.open == []
    assert outline.fetched == []
    assert not re.search(r"(?:https?:)?//|url\(|@import", re.sub(r"base64,[A-Za-z0-9+/=]+", "", page))
    assert outline.figures == outline.captions >= 10
    assert "Ball &lt;&amp;&gt;" in page
    for each in report.judged:
        assert each.name in page
        assert each.name in field_text(report)


def test_the_figures_are_plain_json(report: FieldReport) -> None:
    figures = json.loads(json.dumps(field_json(report), allow_nan=False))
    assert set(figures["harmonics"]) == {"studio", "party"}
    kept = figures["harmonics"]["party"]
    assert kept["degree_2_psnr_db"] < kept["degree_8_psnr_db"]


def test_spots_without_landmarks_are_spread_over_the_person(report: FieldReport) -> None:
    matte = report.truth.samples.matte
    spots = face_spots({}, matte)
    assert len({(spot.x, spot.y) for spot in spots}) == 5
    assert all(matte[spot.y, spot.x] > 0.5 for spot in spots)


def test_a_spot_is_named_on_the_command_line(report: FieldReport) -> None:
    matte = report.truth.samples.matte
    assert parse_spot("ear=20,24", matte) == Spot("ear", 20, 24)
    for wrong in ("ear", "=1,2", "ear=1", "ear=1.5,2", "ear=0,0", "ear=99,99"):
        with pytest.raises(InputError):
            parse_spot(wrong, matte)
