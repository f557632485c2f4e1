"""Face stabilizers on a film with known motion."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from relit_camera.base.errors import InputError
from relit_camera.capture.alignment.rigid_transform import RigidTransform, transforms_to_array
from relit_camera.cli.main import app
from relit_camera.lab.evaluate.stabilization import stabilization_accuracy
from relit_camera.lab.evaluate.stabilization.baseline_stabilizers import BASELINE_STABILIZERS, register_landmarks
from relit_camera.lab.evaluate.stabilization.stabilization_accuracy import (
    StabilizationReport,
    compare_stabilization,
    stabilization_json,
    stabilization_page,
    stabilization_text,
)
from tests.capture.film.moving_face_film import CIRCLE, SIZE, Move, film_moving, moved, texture, wandering
from tests.lab.html_outline import Outline

pytestmark = pytest.mark.slow

FRAMES = 90


def write_truth(path: Path, moves: list[Move]) -> Path:
    """The truth.json of a film with these moves, as far as it is read."""
    rows = transforms_to_array([RigidTransform(move.degrees, move.x, move.y).inverse() for move in moves]).tolist()
    rests = [{"to_rest": {"rotation_deg": turn, "translation_px": [x, y]}} for turn, x, y in rows]
    path.write_text(json.dumps({"frames": [{"head": rest} for rest in rests]}))
    return path


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A video and its truth."""
    folder = tmp_path_factory.mktemp("film")
    moves = wandering(FRAMES)
    return film_moving(folder / "clip.mp4", moves), write_truth(folder / "truth.json", moves)


@pytest.fixture(scope="module")
def report(film: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> StabilizationReport:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RELIT_MODELS_DIR", str(tmp_path_factory.mktemp("no_models")))
        return compare_stabilization(*film)


def test_none_leaves_the_motion_as_it_is(report: StabilizationReport) -> None:
    none = report.errors[0]
    shift = np.array([[move.x, move.y] for move in wandering(FRAMES)])[report.index]
    assert none.method == "none"
    assert none.distance_px == pytest.approx(np.hypot(*(shift - shift.mean(axis=0)).T), abs=0.1)


def test_ways_through_the_dark_frames_beat_those_through_the_bright_ones(report: StabilizationReport) -> None:
    rms = {(each.method, each.seen): float(np.sqrt(np.mean(each.distance_px**2))) for each in report.errors}
    assert [name for name, _ in rms] == ["none", *(name for name in BASELINE_STABILIZERS for _ in range(2)), "ours"]
    for name in BASELINE_STABILIZERS:
        assert rms[name, "dark"] < rms[name, "bright"]
        assert rms[name, "dark"] < 0.4 * rms["none", "both"]
    assert rms["ours", "both"] < 0.15
    assert rms["ours", "both"] < rms["sparse flow", "dark"]


@pytest.mark.parametrize("name", BASELINE_STABILIZERS)
def test_each_way_finds_small_motions_under_one_light(name: str) -> None:
    moves = [Move(), *wandering(8, seed=5, pixels=2.0)]
    squares = np.stack([255 * moved(texture(), move) for move in moves]).clip(0, 255).astype(np.uint8)[:, :240]
    found = BASELINE_STABILIZERS[name](squares, CIRCLE)
    transforms = [transform for transform in found if transform]
    assert len(transforms) == len(moves)
    # The squares' center is 20 px above the picture's.
    center = np.array([[SIZE[0] / 2, 120]])
    for transform, move in zip(transforms, moves, strict=True):
        still = RigidTransform(move.degrees, move.x, move.y).inverse()
        first = RigidTransform(transforms[0].rotation_deg, transforms[0].x, transforms[0].y).inverse()
        left = transform.then(first).apply(center, (SIZE[0], 240)) - still.apply(center, SIZE)
        assert np.abs(left).max() < 0.5


def test_landmarks_are_registered_where_there_are_some() -> None:
    points = np.random.default_rng(0).uniform(50, 200, (20, 2)).astype(np.float32)
    turned = RigidTransform(2, 3, -1).inverse().apply(points, SIZE).astype(np.float32)
    none = np.zeros((0, 2), np.float32)
    found = register_landmarks([none, points, none, turned], SIZE)
    assert found[0] is None
    assert found[2] is None
    seen = transforms_to_array([transform for transform in found if transform])
    np.testing.assert_allclose(seen, np.array([[0, 0, 0], [2, 3, -1]], float), atol=1e-3)
    assert register_landmarks([none, none], SIZE) == [None, None]


def test_the_report_tells_everything(report: StabilizationReport) -> None:
    told = json.loads(json.dumps(stabilization_json(report)))
    assert told["bright_frames"] == len(report.index)
    assert told["methods"][-1]["method"] == "ours"
    assert told["methods"][-1]["translation_rms_px"] < told["methods"][-1]["translation_max_px"]
    assert "relit models pull" in told["left_out"]["landmarks"]
    text = stabilization_text(report)
    assert "sparse flow, dark frames" in text
    assert "landmarks: left out" in text
    page = stabilization_page(report, "A film")
    outline = Outline()
    outline.feed(page)
    assert outline.fetched == outline.open == []
    assert outline.figures == 3
    assert sum(b"<svg" in image for image in outline.images) == 2
    assert "template matching, bright frames" in page


def test_a_truth_of_another_video_is_refused(film: tuple[Path, Path], tmp_path: Path) -> None:
    other = write_truth(tmp_path / "truth.json", [Move()] * 7)
    with pytest.raises(InputError, match=r"has 90 frames, .*truth\.json 7; both must be of the same video"):
        compare_stabilization(film[0], other)
    (tmp_path / "empty.json").write_text("{}")
    with pytest.raises(InputError, match=r"give the truth\.json of a rendered capture"):
        compare_stabilization(film[0], tmp_path / "empty.json")


def test_the_command(
    film: tuple[Path, Path], report: StabilizationReport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[tuple[Path, ...]] = []

    def compare(*paths_and_progress: object) -> StabilizationReport:
        given.append(tuple(path for path in paths_and_progress if isinstance(path, Path)))
        return report

    monkeypatch.setattr(stabilization_accuracy, "compare_stabilization", compare)
    command = ["evaluate", "stabilisation", str(film[0]), "--truth", str(film[1]), "--json"]
    result = CliRunner().invoke(app, [*command, "--out", str(tmp_path / "page.html")])
    assert result.exit_code == 0, result.output
    assert given == [film]
    assert json.loads(result.stdout) == stabilization_json(report)
    assert (tmp_path / "page.html").read_text().startswith("<!doctype html>")
