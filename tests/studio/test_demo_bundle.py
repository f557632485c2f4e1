"""The demonstration's files, from small folders of the kind that `field` and `drive` leave."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from relit_camera.app.captures.expression_capture import ExpressionCapture
from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import Frame
from relit_camera.capture.expressions.still_selection import Selection
from relit_camera.capture.subject_builder import build_subject
from relit_camera.face.matting import RecordedMatting
from relit_camera.face.tracking.track_recording import read_track
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import count_stills, read_subject
from relit_studio import demo_bundle
from relit_studio.demo_bundle import make_bundle
from tests.app.still_builders import grey_still

pytestmark = pytest.mark.slow

SIDE = 96
BUILT: list[Subject] = []


@pytest.fixture(autouse=True)
def build_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Build the subject in the first test that needs it; all give the same pictures."""

    def build(*arguments: Any) -> Subject:
        if not BUILT:
            BUILT.append(build_subject(*arguments))
        return BUILT[0]

    monkeypatch.setattr(demo_bundle, "build_subject", build)


@pytest.fixture
def rendered(generated: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A field's and a clip's folder."""
    field, clip = tmp_path / "field", tmp_path / "clip"
    shutil.copytree(generated / "olat", field)
    (field / "field.json").write_text(json.dumps({"person": {"name": "adam"}}))
    (clip / "frames").mkdir(parents=True)
    shutil.copy(generated / "clip.mp4", clip / "clip.mp4")
    shutil.copy(generated / "track.json", clip / "track.json")
    (clip / "drive.json").write_text(json.dumps({"person": {"name": "adam"}}))
    (clip / "truth.json").write_text(json.dumps({"credits": ["A scan by Somebody, CC-BY 3.0"]}))
    for index in range(3):
        planes = {name: np.zeros((SIDE, SIDE), np.float32) for name in "RGB"}
        alpha = np.zeros((SIDE, SIDE), np.float32)
        alpha[20 + 8 * index :] = 1
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {**planes, "A": alpha}).write(str(clip / "frames" / f"{index:04d}.exr"))
    return field, clip


def test_the_demo_has_all_it_needs(rendered: tuple[Path, Path], tmp_path: Path) -> None:
    made = make_bundle(*rendered, tmp_path / "out", 6)
    assert sorted(path.name for path in made) == ["CREDITS.md", "adam.relit", "clip.mp4", "mattes.npz", "track.json"]
    assert read_subject(tmp_path / "out" / "adam.relit").metadata.components == 6
    assert "A scan by Somebody" in (tmp_path / "out" / "CREDITS.md").read_text()
    given, kept = read_track(rendered[1] / "track.json"), read_track(tmp_path / "out" / "track.json")
    for before, after in zip(given.frames, kept.frames, strict=True):
        np.testing.assert_allclose(after.landmarks, before.landmarks, atol=5.1e-4)
    mattes = RecordedMatting(tmp_path / "out" / "mattes.npz")
    for index in range(3):
        found = mattes.matte(Frame(np.zeros((SIDE, SIDE, 3), np.uint8), index, 0.0, 0.0))
        assert found[: 18 + 8 * index].max() == 0
        assert found[22 + 8 * index :].min() == 255


def test_it_has_the_expression_stills_of_another_film(
    rendered: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    films: list[Path] = []

    def capture(film: Path, subject: Subject) -> ExpressionCapture:
        films.append(film)
        return ExpressionCapture((grey_still(),), Selection((), ()))

    monkeypatch.setattr(demo_bundle, "capture_expressions", capture)
    other = tmp_path / "other"
    shutil.copytree(rendered[1], other)
    make_bundle(*rendered, tmp_path / "out", 6, expressions=other)
    assert films == [other / "clip.mp4"]
    assert count_stills(tmp_path / "out" / "adam.relit") == 1
    (other / "drive.json").write_text(json.dumps({"person": {"name": "bea"}}))
    with pytest.raises(InputError, match=r"of adam, and .* of bea"):
        make_bundle(*rendered, tmp_path / "out", 6, expressions=other)


def test_two_people_are_not_mixed(rendered: tuple[Path, Path], tmp_path: Path) -> None:
    field, clip = rendered
    (clip / "drive.json").write_text(json.dumps({"person": {"name": "bea"}}))
    with pytest.raises(InputError, match=r"of adam, and .* of bea"):
        make_bundle(field, clip, tmp_path / "out", 6)
    assert not (tmp_path / "out").exists()


def test_a_clip_that_is_not_finished_is_refused(rendered: tuple[Path, Path], tmp_path: Path) -> None:
    field, clip = rendered
    (clip / "frames" / "0002.exr").unlink()
    with pytest.raises(InputError, match="has 2 frames, its track 3"):
        make_bundle(field, clip, tmp_path / "out", 6)


@pytest.mark.parametrize("missing", ["field.json", "drive.json"])
def test_a_folder_of_something_else_is_refused(rendered: tuple[Path, Path], tmp_path: Path, missing: str) -> None:
    for folder in rendered:
        (folder / missing).unlink(missing_ok=True)
    with pytest.raises(InputError, match=f"there is no .*{missing}"):
        make_bundle(*rendered, tmp_path / "out", 6)


def test_what_is_too_large_to_ship_is_said(
    rendered: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(demo_bundle.MAX_BYTES, "adam.relit", 1000)
    with pytest.raises(InputError, match=r"adam\.relit would have .* MB"):
        make_bundle(*rendered, tmp_path / "out", 6)
    assert list((tmp_path / "out").iterdir()) == []
