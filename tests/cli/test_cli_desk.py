"""`relit capture desk`: from a folder of frames to a subject; bad input is one line, and nothing is left."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.base.images.image_files import write_display
from relit_camera.capture.desk import desk_capture
from relit_camera.subject.subject_file import read_metadata
from tests.capture.desk.desk_person import film, lambertian_person
from tests.cli.relit_command import call


def test_a_recorded_folder_becomes_a_subject(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # An ellipsoid is no person to a network.
    monkeypatch.setattr(desk_capture, "segment_person", lambda picture: None)
    monkeypatch.setattr(desk_capture, "find_mesh_landmarks", lambda picture: None)
    folder, out = tmp_path / "evening", tmp_path / "me.relit"
    folder.mkdir()
    recording = film(lambertian_person())
    for index in range(len(recording.frames)):
        write_display(folder / f"{index:04d}.png", recording.frames[index])
    (folder / "desk.json").write_text(recording.setup.model_dump_json(), encoding="utf-8")
    answer = call("capture", "desk", "--frames", folder, "--out", out)
    assert answer.code == 0, answer.err
    assert "6 patches" in answer.out
    metadata = read_metadata(out)
    assert (metadata.rung, metadata.source, metadata.lights) == ("desk", "evening", 6)


def test_what_is_missing_or_wrong_is_named_and_nothing_is_left(tmp_path: Path) -> None:
    out = tmp_path / "me.relit"
    call("capture", "desk", "--frames", tmp_path / "nowhere", "--out", out).complains("there is no folder", "nowhere")
    call("capture", "desk", "--frames", tmp_path, "--out", out).complains("desk.json")
    (tmp_path / "desk.json").write_text('{"distance_cm": 1}', encoding="utf-8")
    call("capture", "desk", "--frames", tmp_path, "--out", out).complains("desk.json", "screen")
    assert [path.name for path in tmp_path.iterdir()] == ["desk.json"]
