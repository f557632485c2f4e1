from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relit_camera.base.errors import NotFoundError, StorageError, TrackError
from relit_camera.base.images.image_types import Frame
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.tracking.track_recording import TrackRecorder, read_track
from relit_camera.face.tracking.trackers import open_tracker
from tests.face.faces import SCHEME, SIZE, face


class NamedTracker:
    name = "fake"
    scheme = SCHEME.name

    def track(self, frame: Frame) -> FaceState:
        return LOST

    def reset(self) -> None: ...


STATES = [
    face(10.123456, -5.5, 3.25, at=(1.1, 2.2, -47.3), noise_px=0.3),
    LOST,
    face(0, 0, 0, status=FaceStatus.UNCERTAIN),
]


@pytest.fixture
def track_path(tmp_path: Path) -> Path:
    recorder = TrackRecorder(NamedTracker(), SIZE, 30.0)
    for index, state in enumerate(STATES):
        recorder.add(state, index / 30)
    recorder.write(tmp_path / "t.json")
    return tmp_path / "t.json"


def frame(index: int, size: tuple[int, int] = SIZE) -> Frame:
    return Frame(np.zeros((size[1], size[0], 3), np.uint8), index, 0.0, index / 30)


def assert_same(state: FaceState, expected: FaceState) -> None:
    assert (state.status, state.scheme) == (expected.status, expected.scheme)
    assert (state.confidence, state.eyes, state.mouth) == (expected.confidence, expected.eyes, expected.mouth)
    np.testing.assert_array_equal(state.landmarks, expected.landmarks)
    assert state.landmarks.dtype == np.float32
    assert (state.pose is None) == (expected.pose is None)
    if state.pose is not None and expected.pose is not None:
        np.testing.assert_array_equal(state.pose.translation, expected.pose.translation)
        assert (state.pose.rotation.inv() * expected.pose.rotation).magnitude() < 1e-12
        assert state.pose.focal_px == expected.pose.focal_px


def test_a_track_plays_back_exactly_and_begins_again(track_path: Path):
    tracker = open_tracker(f"recorded:{track_path}")
    assert tracker.scheme == SCHEME.name
    for index in range(7):
        assert_same(tracker.track(frame(index)), STATES[index % 3])
    tracker.reset()
    assert_same(tracker.track(frame(5)), STATES[2])


def test_the_file_says_what_it_promises(track_path: Path):
    track = json.loads(track_path.read_text())
    assert track["version"] == 1
    assert track["size"] == list(SIZE)
    assert track["scheme"] == SCHEME.name
    first, lost, _ = track["frames"]
    assert first["found"] is True
    assert first["pose"] == {"yaw": pytest.approx(10.123456), "pitch": pytest.approx(-5.5), "roll": pytest.approx(3.25)}
    assert np.array(first["landmarks"]).shape == (SCHEME.count, 2)
    assert len(first["eyes"]) == 2
    assert lost["found"] is False
    assert lost["pose"] is None


def test_the_share_of_frames_with_a_face() -> None:
    recorder = TrackRecorder(NamedTracker(), SIZE, 30.0)
    assert recorder.found_fraction == 0
    for state in STATES:
        recorder.add(state, 0.0)
    assert recorder.found_fraction == pytest.approx(2 / 3)


def test_a_track_of_nothing_is_not_written(tmp_path: Path):
    with pytest.raises(TrackError, match="no frames"):
        TrackRecorder(NamedTracker(), SIZE, 30.0).write(tmp_path / "t.json")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_nothing(tmp_path: Path):
    recorder = TrackRecorder(NamedTracker(), SIZE, 30.0)
    recorder.add(STATES[0], 0.0)
    with pytest.raises(StorageError, match="none"):
        recorder.write(tmp_path / "none" / "t.json")


def broken(path: Path, change: str) -> None:
    """Damage a good track file in one named way."""
    track: dict[str, Any] = json.loads(path.read_text())
    first = track["frames"][0]
    match change:
        case "version":
            track["version"] = 7
        case "scheme":
            track["scheme"] = "ibug68"
        case "landmarks":
            first["landmarks"].pop()
        case "pose":
            first["pose"] = None
        case "behind":
            first["translation"][2] = 3.0
        case "nan":
            first["mouth"] = float("nan")
        case "empty":
            track["frames"] = []
        case "size":
            track["size"] = [0, 480]
        case "status":
            first["status"] = "lost"
        case "missing":
            del track["fps"]
    path.write_text(json.dumps(track))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("version", "is of version 7, this program reads 1"),
        ("scheme", "unknown landmark scheme 'ibug68'"),
        ("landmarks", "frame 0 has 65 landmarks, and openseeface66 has 66"),
        ("pose", r"frames\.0: a found face needs pose"),
        ("behind", r"frames\.0: translation puts the face behind the camera"),
        ("nan", r"frames\.0\.mouth"),
        ("empty", "frames"),
        ("size", r"size\.0"),
        ("status", "found is true, but status is lost"),
        ("missing", "fps: Field required"),
    ],
)
def test_a_bad_track_says_where(track_path: Path, change: str, says: str):
    broken(track_path, change)
    with pytest.raises(TrackError, match=says) as caught:
        read_track(track_path)
    assert "relit track" in caught.value.cure
    assert str(track_path) in caught.value.what


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b"null", b'{"version": 1}'])
def test_what_is_no_track_is_said_to_be_none(tmp_path: Path, content: bytes):
    path = tmp_path / "t.json"
    path.write_bytes(content)
    with pytest.raises(TrackError, match="no usable track"):
        read_track(path)


def test_a_missing_file_and_a_folder(tmp_path: Path):
    with pytest.raises(TrackError, match=r"cannot read track .*none\.json: No such file"):
        open_tracker(f"recorded:{tmp_path / 'none.json'}")
    with pytest.raises(TrackError, match="cannot read track"):
        read_track(tmp_path)


def test_recorded_needs_a_path() -> None:
    with pytest.raises(TrackError, match="recorded:PATH"):
        open_tracker("recorded")


def test_pictures_of_another_size_are_refused(track_path: Path):
    with pytest.raises(TrackError, match="is of 640x480 pictures, and this one is 320x240"):
        open_tracker(f"recorded:{track_path}").track(frame(0, (320, 240)))


def test_an_unknown_tracker_names_those_there_are() -> None:
    with pytest.raises(NotFoundError, match=r"'eyes'; there are: .*mesh.*openseeface.*recorded"):
        open_tracker("eyes")
