"""A field cut as a capture cut its film: against the same points followed by hand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import InputError
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.field.candidates import Candidate
from relit_camera.lab.evaluate.field.captured_ground_truth import crop_like_capture, scale_to_truth
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth
from tests.synthetic import sphere_samples


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    report, truth = tmp_path / "report.json", tmp_path / "truth.json"
    square = {"left": 40.0, "top": 20.0, "side": 80.0, "size": 40}
    report.write_text(
        json.dumps({"width_px": 200, "height_px": 160, "square": square, "motion": {"reference": 1}, "frames": []})
    )
    frames = [{"head": {"to_rest": {"rotation_deg": 0, "translation_px": shift}}} for shift in ([9, 9], [6, -4])]
    truth.write_text(json.dumps({"frames": frames}))
    return report, truth


def test_a_point_of_the_field_is_where_the_film_shows_it(files: tuple[Path, Path]) -> None:
    x, y = np.meshgrid(np.arange(100) + 0.5, np.arange(80) + 0.5)
    blob = np.exp(-((x - 45) ** 2 + (y - 28) ** 2) / 18).astype(np.float32)
    field = OlatSamples(np.repeat(blob[None, ..., None], 3, axis=3), np.array([[0.0, 0.0, 1.0]]), np.ones_like(blob))
    seen = crop_like_capture(field, *files)
    assert seen.pictures.shape == (1, 40, 40, 3)
    row, column = np.unravel_index(seen.pictures[0, ..., 0].argmax(), (40, 40))
    # Twice as large in the video, back by the reference's own shift, then cut and halved.
    assert column + 0.5 == pytest.approx((45 * 2 - 6 - 40) / 2, abs=0.6)
    assert row + 0.5 == pytest.approx((28 * 2 + 4 - 20) / 2, abs=0.6)


def test_files_of_two_films_are_refused(files: tuple[Path, Path]) -> None:
    files[1].write_text(json.dumps({"frames": [{"head": {"to_rest": {"rotation_deg": 0, "translation_px": [0, 0]}}}]}))
    field = OlatSamples(np.zeros((1, 8, 10, 3), np.float32), np.array([[0.0, 0.0, 1.0]]), np.ones((8, 10), np.float32))
    with pytest.raises(InputError, match="tells of frame 1, which"):
        crop_like_capture(field, *files)


def test_the_unit_is_the_truths() -> None:
    truth = GroundTruth(sphere_samples(12, 16))
    gains = np.array([0.5, 1.0, 2.0], np.float32)
    candidate = Candidate("dim", truth.inside, lambda directions, pixels: truth.colors * gains)
    same, found = scale_to_truth(candidate, truth, np.arange(12))
    np.testing.assert_allclose(found, 1 / gains, rtol=1e-5)
    np.testing.assert_allclose(same.pictures_at(truth.directions), truth.colors, rtol=1e-5)
