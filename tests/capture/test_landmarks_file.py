"""Known landmarks beside the lights."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import LightsError, NotFoundError
from relit_camera.capture.subject_landmarks import read_landmarks

POINTS = np.random.default_rng(3).uniform(0, 200, (66, 2)).round(2)


def write(folder: Path, content: object) -> Path:
    path = folder / "landmarks.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def test_points_are_read_by_scheme(tmp_path: Path) -> None:
    found = read_landmarks(write(tmp_path, {"openseeface66": POINTS.tolist()}), required=True)
    assert list(found) == ["openseeface66"]
    np.testing.assert_allclose(found["openseeface66"], POINTS, rtol=1e-6)


def test_a_missing_file_is_no_landmarks_unless_it_was_asked_for(tmp_path: Path) -> None:
    assert read_landmarks(tmp_path / "none.json", required=False) == {}
    with pytest.raises(LightsError, match=r"none\.json"):
        read_landmarks(tmp_path / "none.json", required=True)


@pytest.mark.parametrize(
    ("content", "error", "message"),
    [
        ("{", LightsError, "holds no landmarks"),
        ({"openseeface66": [[1, 2, 3]]}, LightsError, "holds no landmarks"),
        ({"openseeface66": POINTS[:65].tolist()}, LightsError, "65 points of openseeface66, which has 66"),
        ({"openseeface66": []}, LightsError, "0 points"),
        ({"mesh99": [[1, 2]]}, NotFoundError, "mesh99"),
    ],
)
def test_what_is_no_face_is_one_clear_error(
    tmp_path: Path, content: object, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        read_landmarks(write(tmp_path, content), required=False)
