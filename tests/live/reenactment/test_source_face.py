"""The face in the still: as the live tracker sees it, else as stored with the subject."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import SubjectError
from relit_camera.base.images.image_types import Frame
from relit_camera.face.face_state import LOST, FaceState, FaceStatus, Tracker
from relit_camera.face.tracking.track_recording import RecordedTracker, TrackRecorder
from relit_camera.face.tracking.trackers import TrackerOptions
from relit_camera.lab.bench.synthetic_tracker import SyntheticTracker
from relit_camera.live.reenactment.source_image import find_source_face
from tests.live.people import LIVE_NEUTRAL, SCHEME, Blind, person


class Seeing:
    """A tracker that sees the stored face 2 px farther right, or none."""

    name, scheme = "mesh", SCHEME.name

    def __init__(self, sees: bool = True) -> None:
        self.sees = sees

    def reset(self) -> None:
        """Nothing is kept."""

    def track(self, frame: Frame) -> FaceState:
        if not self.sees:
            return LOST
        points = person().landmarks[SCHEME.name] + np.array([2, 0], np.float32)
        return FaceState(FaceStatus.FOUND, 1.0, SCHEME.name, points, LIVE_NEUTRAL)


def test_the_live_tracker_looks_at_the_still_itself() -> None:
    face = find_source_face(person(), Seeing())
    np.testing.assert_allclose(face.landmarks - person().landmarks[SCHEME.name], [[2, 0]] * SCHEME.count, atol=1e-4)


@pytest.fixture
def recorded(tmp_path: Path) -> RecordedTracker:
    """A recording of a face that would be elsewhere in the source image."""
    tracker, frame = SyntheticTracker(), Frame(person().neutral, 0, 0.0, 0.0)
    recorder = TrackRecorder(tracker, frame.size, 30.0)
    recorder.add(tracker.track(frame), 0.0)
    recorder.write(tmp_path / "track.json")
    return RecordedTracker(TrackerOptions(str(tmp_path / "track.json")))


def test_a_recording_has_not_seen_the_source_image(recorded: RecordedTracker) -> None:
    assert recorded.track(Frame(person().neutral, 0, 0.0, 0.0)).visible
    np.testing.assert_array_equal(find_source_face(person(), recorded).landmarks, person().landmarks[SCHEME.name])


@pytest.mark.parametrize("tracker", [Blind(), Seeing(False)])
def test_else_the_stored_landmarks_count(tracker: Tracker) -> None:
    np.testing.assert_array_equal(find_source_face(person(), tracker).landmarks, person().landmarks[SCHEME.name])


def test_a_still_without_a_face_is_refused() -> None:
    with pytest.raises(SubjectError, match="finds no face"):
        find_source_face(dataclasses.replace(person(), landmarks={}), Seeing(False))
