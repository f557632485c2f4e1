"""The face in the still: as the live tracker sees it, else as stored with the subject."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from relit_camera.base.errors import SubjectError
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.live.reenactment.source_image import find_source_face
from tests.live.people import LIVE_NEUTRAL, SCHEME, Looker, person


class Seeing:
    """A tracker that sees the stored face 2 px farther right, or none."""

    name, scheme = "mesh", SCHEME.name

    def __init__(self, sees: bool = True) -> None:
        self.sees = sees

    def reset(self) -> None:
        """Nothing is kept."""

    def track(self, frame) -> FaceState:
        if not self.sees:
            return LOST
        points = person().landmarks[SCHEME.name] + np.float32([2, 0])
        return FaceState(FaceStatus.FOUND, 1.0, SCHEME.name, points, LIVE_NEUTRAL)


def test_the_live_tracker_looks_at_the_still_itself():
    face = find_source_face(person(), Seeing())
    np.testing.assert_allclose(face.landmarks - person().landmarks[SCHEME.name], [[2, 0]] * SCHEME.count, atol=1e-4)


@pytest.mark.parametrize("tracker", [Looker(), Seeing(False)], ids=["recorded", "sees none"])
def test_else_the_stored_landmarks_count(tracker):
    np.testing.assert_array_equal(find_source_face(person(), tracker).landmarks, person().landmarks[SCHEME.name])


def test_a_still_without_a_face_is_refused():
    with pytest.raises(SubjectError, match="finds no face"):
        find_source_face(dataclasses.replace(person(), landmarks={}), Seeing(False))
