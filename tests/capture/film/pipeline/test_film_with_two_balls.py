"""A film with two mirror balls: the lamp's distance is measured, and its direction is more accurate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.ball.ball_tracking import ObservedBall
from relit_camera.capture.film.ball.specular_highlight import Highlight, NoHighlight
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.lamp.capture_layout import estimate_capture_layout, eye_distance_from_face
from relit_camera.capture.film.lamp.lamp_localization import LampPositions, locate_lamps
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.film.pipeline.capture_report import CaptureFindings
from relit_camera.capture.film.pipeline.film_capture import CaptureResult, build_samples
from tests.capture.film.ball.mirror_scene import degrees_between
from tests.capture.film.generated_film import FOCAL_PX, HEAD, PX_PER_CM, Film, with_ball, write_film

pytestmark = pytest.mark.slow

FILM = Film(frames=120, distance_cm=80, sway=12, second=with_ball(-85, 75, 1))
OPTIONS = CaptureOptions(gamma=2.2, size=64, focal_px=FOCAL_PX, face=FaceCircle(*HEAD, 9.5 * PX_PER_CM), balls=2)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> CaptureResult:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RELIT_MODELS_DIR", str(tmp_path_factory.mktemp("models")))
        return build_samples(write_film(tmp_path_factory.mktemp("film") / "film.mp4", FILM.codes()), OPTIONS)


@pytest.fixture(scope="module")
def findings(built: CaptureResult) -> CaptureFindings:
    return built.findings


def located(findings: CaptureFindings, *balls: ObservedBall) -> LampPositions:
    """The lamps by these balls alone."""
    circle = findings.motion.circle
    layout = estimate_capture_layout(
        [ball.view for ball in balls], (circle.x, circle.y), eye_distance_from_face(circle.radius)
    )
    times_s = findings.flashes.times_s
    return locate_lamps(balls, findings.usable.bright, times_s, layout, OPTIONS.light_distance_cm)


def true_cm(lamps: LampPositions) -> np.ndarray:
    return np.array([np.linalg.norm(FILM.lamp_cm(index)) for index in lamps.index])


def off_deg(lamps: LampPositions) -> np.ndarray:
    pairs = zip(lamps.directions, lamps.index, strict=True)
    return np.array([degrees_between(direction, FILM.lamp_cm(index)) for direction, index in pairs])


def test_the_lamps_distance_is_measured(built: CaptureResult) -> None:
    lamps = built.findings.lamps
    ratio = lamps.distances.cm / true_cm(lamps)
    assert np.std(np.log(true_cm(lamps))) > 0.08
    assert np.median(ratio) == pytest.approx(1, abs=0.05)
    assert np.std(np.log(ratio)) < 0.06


def test_the_direction_is_better_than_by_either_ball(findings: CaptureFindings) -> None:
    both = off_deg(findings.lamps).mean()
    for alone in findings.balls:
        assert both < 0.7 * off_deg(located(findings, alone)).mean()


def test_where_one_ball_shows_the_lamp_its_distance_is_interpolated(findings: CaptureFindings) -> None:
    whole = findings.lamps
    first, second = findings.balls
    gone = set(whole.index[10:13].tolist())
    highlights = {index: NoHighlight("gone") if index in gone else each for index, each in second.highlights.items()}
    lamps = located(findings, first, replace(second, highlights=highlights))
    np.testing.assert_array_equal(lamps.index, whole.index)
    assert not gone & set(lamps.triangulated)
    changed = np.isin(lamps.index, list(gone))
    np.testing.assert_allclose(lamps.distances.cm[changed], true_cm(lamps)[changed], rtol=0.12)
    assert (lamps.distances.error[changed] > whole.distances.error[changed]).all()


def test_a_frame_in_which_they_show_different_things_is_left_out(findings: CaptureFindings) -> None:
    first, second = findings.balls
    index = int(findings.lamps.index[20])
    other = second.highlights[index - 24]
    assert isinstance(other, Highlight)
    wrong = replace(second, highlights=dict(second.highlights) | {index: other})
    lamps = located(findings, first, wrong)
    assert lamps.unusable[index] == "the two balls show the lamp in different places"
    assert index not in lamps.index


def test_the_report_has_the_source_of_the_distance(built: CaptureResult) -> None:
    report, lamps = built.findings.report(), built.findings.lamps
    distance = report["lamp_distance"]
    assert distance["source"] == "two balls"
    assert distance["frames"] == len(lamps.triangulated) > 40
    assert 0 < distance["gap_deg"] < 1
    assert 0 < distance["error"] < 0.15
    assert distance["median_cm"] == pytest.approx(80, rel=0.06)
    distances = [frame["distance_cm"] for frame in report["frames"] if "distance_cm" in frame]
    np.testing.assert_allclose(distances, lamps.distances.cm, atol=0.01)
    assert report["second_ball"]["radius_cm"] == report["ball"]["radius_cm"]
    assert abs(report["second_ball"]["x"] - report["ball"]["x"]) > 100


def test_balls_that_disagree_cause_warnings(built: CaptureResult) -> None:
    findings = built.findings
    apart = {index: replace(each, gap_deg=2.5) for index, each in findings.lamps.triangulated.items()}
    amiss = replace(findings, lamps=replace(findings.lamps, triangulated=apart))
    assert any("the two balls disagree about the lamp by 2.5 degrees" in warning for warning in amiss.warnings)
    few = dict(list(apart.items())[:10])
    amiss = replace(findings, lamps=replace(findings.lamps, triangulated=few))
    assert any(warning.startswith("both balls show the lamp in 2") for warning in amiss.warnings)
    assert not any("balls" in warning for warning in findings.warnings)


def test_circles_that_are_no_balls_of_one_size_are_refused(findings: CaptureFindings) -> None:
    first, second = findings.balls
    small = replace(second.found.outline, radius=second.found.outline.radius / 2)
    wrong = replace(second, view=second.view.with_outline(small))
    with pytest.raises(CaptureError, match=r"show the lamp in different places in \d+ of \d+ frames; .*of one size"):
        located(findings, first, wrong)
