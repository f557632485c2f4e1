"""`relit capture desk`: from a folder of frames to a subject; bad input is one line, and nothing is left."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.rotations import Rotation
from relit_camera.capture.desk import desk_capture
from relit_camera.capture.desk.desk_recording import DeskRecording
from relit_camera.capture.desk.person import desk_face
from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.head_pose import HeadPose
from relit_camera.subject.subject_file import read_metadata
from tests.capture.desk.bundled_person import write_recording
from tests.capture.desk.desk_person import SETUP, film, lambertian_person
from tests.cli.relit_command import call


@dataclass(frozen=True)
class Found:
    """A detector that finds these faces in every picture."""

    faces: list[Detection]

    def detect_all(self, picture: DisplayImage) -> list[Detection]:
        return self.faces


@pytest.fixture(scope="module")
def good() -> DeskRecording:
    """A recording that becomes a subject."""
    return film(lambertian_person())


@pytest.mark.slow
def test_a_recorded_folder_becomes_a_subject(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, good: DeskRecording
) -> None:
    monkeypatch.setattr(desk_capture, "SIZE_PX", 128)  # a quarter of the pixels, a third of the time
    # An ellipsoid is no person to a network.
    monkeypatch.setattr(desk_capture, "segment_person", lambda picture: None)
    monkeypatch.setattr(desk_capture, "find_mesh_landmarks", lambda picture: None)
    folder, out = write_recording(tmp_path / "evening", good), tmp_path / "me.relit"
    answer = call("capture", "desk", "--frames", folder, "--out", out)
    assert answer.code == 0, answer.err
    assert "6 patches" in answer.out
    metadata = read_metadata(out)
    assert (metadata.rung, metadata.source, metadata.lights) == ("desk", "evening", 6)
    assert 0.01 < (metadata.measured_fraction or 0) < 0.3
    assert "the whites of your eyes are not seen" in answer.err


def test_what_is_missing_or_wrong_is_named_and_nothing_is_left(tmp_path: Path) -> None:
    out = tmp_path / "me.relit"
    call("capture", "desk", "--frames", tmp_path / "nowhere", "--out", out).complains("there is no folder", "nowhere")
    call("capture", "desk", "--frames", tmp_path, "--out", out).complains("desk.json")
    (tmp_path / "desk.json").write_text('{"distance_cm": 1}', encoding="utf-8")
    call("capture", "desk", "--frames", tmp_path, "--out", out).complains("desk.json", "screen")
    assert [path.name for path in tmp_path.iterdir()] == ["desk.json"]


@pytest.mark.slow
def test_a_bad_recording_is_one_clear_line_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, good: DeskRecording
) -> None:
    monkeypatch.setattr(desk_capture, "segment_person", lambda picture: None)
    monkeypatch.setattr(desk_capture, "find_mesh_landmarks", lambda picture: None)
    out = tmp_path / "me.relit"
    frames = [good.frames[index] for index in range(len(good.frames))]
    walls = [np.full_like(frame, frame[:20, :20].mean(axis=(0, 1)).astype(np.uint8)) for frame in frames]
    gone = [*frames[:96], *walls[96:]]
    grid = SETUP.patches
    order = np.arange(grid.count).reshape(grid.rows, grid.columns)[:, ::-1].ravel()
    turned = SETUP.model_copy(
        update={
            "sequence": [
                pattern if isinstance(pattern, str) else [pattern[k] for k in order] for pattern in SETUP.patterns
            ]
        }
    )
    searched = good.setup.model_copy(update={"face": None, "pixels_per_cm": None})
    small = Detection((150, 90, 60, 70), np.array([[168, 118], [192, 118]], np.float32), 0.9)
    face = Detection((150, 90, 100, 120), np.array([[180, 140], [220, 140]], np.float32), 0.9)
    length = len(frames) // len(SETUP.patterns)
    mixed = [index for index, pattern in enumerate(SETUP.patterns) if not isinstance(pattern, str)]
    lost = {frame for index in mixed[2:5] for frame in range(index * length, (index + 1) * length)}
    dark, white = (np.minimum(np.arange(256) * gain, 255).astype(np.uint8) for gain in (0.12, 3))
    for name, recording, faces, words in (
        ("still", replace(good, frames=frames[:1] * 60), [], "no patterns are seen"),
        ("short", replace(good, frames=frames[: len(frames) // 2]), [], "leave the page open"),
        ("lost", replace(good, frames=[frames[k] for k in range(len(frames)) if k not in lost]), [], "are missing"),
        ("dark", replace(good, frames=[dark[frame] for frame in frames]), [], "too dark"),
        ("white", replace(good, frames=[white[frame] for frame in frames]), [], "over-exposed"),
        ("small", replace(good, setup=searched), [small], "only 70 pixels high"),
        ("left", replace(good, frames=gone), [], "stay before the webcam"),
        ("turned", film(lambertian_person(), turned, said=SETUP), [], "mirrored"),
        ("nobody", replace(good, setup=searched), [], "no face is seen"),
        ("two", replace(good, setup=searched), [face, face], "two faces are seen"),
    ):
        monkeypatch.setattr(desk_face, "open_face_detector", lambda faces=faces: Found(faces))
        folder = write_recording(tmp_path / name, recording, ".jpg")
        call("capture", "desk", "--frames", folder, "--out", out).complains(words)
        assert not out.exists()


@pytest.mark.slow
def test_somebody_who_looks_aside_is_told_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, good: DeskRecording
) -> None:
    """The tracker follows a profile, but not from the front."""
    pose = HeadPose(Rotation.from_rotvec([0, np.radians(60), 0]), np.array([0.0, 0.0, -60.0]), 640.0)
    for visible, words in ((True, "turned away from the webcam by 60 degrees"), (False, "seen from the side")):
        state = SimpleNamespace(visible=visible, pose=pose, landmarks=np.zeros((478, 2), np.float32))
        monkeypatch.setattr(desk_face, "open_tracker", lambda name, options: None)
        monkeypatch.setattr(desk_face, "track_still", lambda picture, tracker, state=state: state)
        folder = write_recording(tmp_path / words, good, ".jpg")
        call("capture", "desk", "--frames", folder, "--out", tmp_path / "me.relit").complains(words)
        assert not (tmp_path / "me.relit").exists()
