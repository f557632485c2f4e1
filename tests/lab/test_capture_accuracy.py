"""What a capture found against the truth, with errors put in by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relit_camera.base.errors import InputError
from relit_camera.lab.evaluate.capture_accuracy import (
    CaptureErrors,
    capture_json,
    capture_page,
    capture_text,
    compare_capture,
)
from tests.lab.capture_documents import Document, documents
from tests.lab.html_outline import Outline

Compare = Callable[[object], CaptureErrors]


@pytest.fixture
def truth() -> Document:
    return documents()[0]


@pytest.fixture
def report() -> Document:
    return documents()[1]


@pytest.fixture
def compare(tmp_path: Path, truth: Document) -> Compare:
    def run(report: object) -> CaptureErrors:
        (tmp_path / "truth.json").write_text(json.dumps(truth))
        (tmp_path / "report.json").write_text(report if isinstance(report, str) else json.dumps(report))
        return compare_capture(tmp_path / "report.json", tmp_path / "truth.json")

    return run


def test_a_perfect_capture_has_no_errors(compare: Compare, report: Document) -> None:
    errors = compare(report)
    assert (errors.frames, errors.true_bright, errors.used, errors.wrongly_bright) == (30, 10, 10, 0)
    assert errors.direction_deg.max() < 1e-6
    assert errors.at_ball_deg.max() < 1e-6
    assert abs(errors.rotation_deg).max() < 1e-9
    assert abs(errors.translation_px).max() < 1e-9
    assert errors.ball_px == (0, 0, 0)
    assert errors.focal_ratio == 1


def test_errors_put_in_are_found(compare: Compare, report: Document) -> None:
    for frame in report["frames"]:
        frame["rotation_deg"] += 5 + 0.1 * (-1) ** frame["index"]
        frame["translation_px"][0] += 0.4 * (-1) ** frame["index"]
        if frame["kind"] == "bright":
            known = np.array(frame["direction"])
            across = np.cross(known, [0, 1, 0])
            turned = Rotation.from_rotvec(np.radians(2.5) * across / np.linalg.norm(across)).apply(known)
            frame["direction"] = turned.tolist()
    report["ball"] = {"x": 101.0, "y": 50.0, "radius": 19.5}
    report["focal_px"] = 840.0
    errors = compare(report)
    np.testing.assert_allclose(errors.direction_deg, 2.5, atol=1e-6)
    assert errors.at_ball_deg.max() < 1e-6
    np.testing.assert_allclose(abs(errors.rotation_deg), 0.1, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(errors.translation_px, axis=1), 0.4, atol=1e-9)
    assert errors.ball_px == (1, 0, -0.5)
    assert errors.focal_ratio == pytest.approx(1.05)


def test_the_lights_distance_and_either_ball_are_compared(compare: Compare, truth: Document, report: Document) -> None:
    truth["second_ball"] = {"x_px": 20.0, "y_px": 50.0, "radius_px": 18.0}
    for known, found in zip(truth["frames"], report["frames"], strict=True):
        known["light"]["at_second_ball"] = known["light"]["at_ball"]
        known["light"]["at_ball"] = [0.0, 1.0, 0.0]
        found["distance_cm"] = 95.0
    report["ball"] = {"x": 21.0, "y": 50.0, "radius": 18.0}
    errors = compare(report)
    assert errors.ball_px == (1, 0, 0)
    assert errors.at_ball_deg.max() < 1e-6
    np.testing.assert_allclose(errors.distance_ratio, 0.95)
    figures = json.loads(json.dumps(capture_json(errors), allow_nan=False))
    assert figures["distance"]["mean"] == pytest.approx(0.05)
    assert "light's distance from the head: mean 5.00" in capture_text(errors)


def test_frames_taken_for_others_are_counted(compare: Compare, report: Document) -> None:
    report["frames"][2]["kind"] = "rejected"
    report["frames"][4]["kind"] = "bright"
    errors = compare(report)
    assert (errors.used, errors.wrongly_bright, errors.used_fraction) == (9, 1, 0.9)
    assert len(errors.direction_deg) == 9


def test_what_a_report_does_not_tell_is_null(compare: Compare, report: Document) -> None:
    bare = {"frames": [{"index": frame["index"], "kind": frame["kind"]} for frame in report["frames"]]}
    errors = compare(bare)
    figures = json.loads(json.dumps(capture_json(errors), allow_nan=False))
    assert figures["direction_deg"] is figures["rotation_deg"] is figures["ball_px"] is figures["focal_ratio"] is None
    assert figures["used_share"] == 1
    assert "not told" in capture_text(errors)


@pytest.mark.slow
def test_the_report_is_whole_in_itself(compare: Compare, report: Document) -> None:
    errors = compare(report)
    outline = Outline()
    outline.feed(capture_page(errors, "Capture"))
    assert outline.fetched == outline.open == []
    assert outline.figures == outline.captions == 2
    assert "10 of 10" in capture_text(errors)


def test_wrong_files_are_one_clear_error(compare: Compare, report: Document, tmp_path: Path) -> None:
    unknown, strange = deepcopy(report), deepcopy(report)
    unknown["frames"][0]["kind"] = "lit"
    strange["frames"][3]["index"] = 99
    wrong = {"no JSON": "{", "frames": {}, r"frames\.0\.kind": unknown, "frame 99": strange}
    for place, document in wrong.items():
        with pytest.raises(InputError, match=place):
            compare(document)
    with pytest.raises(InputError, match="cannot read"):
        compare_capture(tmp_path / "none.json", tmp_path / "truth.json")
