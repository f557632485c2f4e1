from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from relit_camera.base.images.image_types import Frame
from relit_camera.face.detection.face_detector import Box, Detection, is_same_face
from relit_camera.face.face_state import LOST, FaceStatus
from relit_camera.face.landmarks.rotated_crop import Crop, bounding_box
from relit_camera.face.tracking.landmark_tracker import LandmarkPrediction, LandmarkTracker
from tests.face.faces import SCHEME, SIZE, BoxCrops, face

FACE = face(at=(0, 0, -80)).landmarks
EYE_SPAN = SCHEME.eye_span(FACE)
IMAGE = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)


class World:
    """Where the face truly is; None without one."""

    def __init__(self) -> None:
        self.points: np.ndarray | None = FACE
        self.detectable = True


class FakeNetwork(BoxCrops):
    """Right when the crop is about right; else as sure of itself, and wrong by what the crop is off."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.reads = 0

    def read(self, image: np.ndarray, crop: Crop) -> LandmarkPrediction:
        self.reads += 1
        truth = self.world.points
        if truth is None:
            return LandmarkPrediction(FACE, 0.01)
        off = np.array(crop.center) - np.array(self.crop_from_points(truth).center)
        reach = 0.5 * EYE_SPAN
        error = off if np.linalg.norm(off) > reach else np.zeros(2)
        return LandmarkPrediction((truth + error).astype(np.float32), 0.99)

    def blendshapes(self, points: np.ndarray) -> Mapping[str, float]:
        return {"jawOpen": 0.25}


class FakeDetector:
    def __init__(self, world: World) -> None:
        self.world = world
        self.calls = 0
        self.nearby_calls = 0

    def detect_nearby(self, image: np.ndarray, box: Box) -> Detection | None:
        self.nearby_calls += 1
        found = self._truth()
        return found if found is not None and is_same_face(found.box, box) else None

    def detect(self, image: np.ndarray, near: object = None, besides: object = ()) -> Detection | None:
        self.calls += 1
        return self._truth()

    def _truth(self) -> Detection | None:
        if self.world.points is None or not self.world.detectable:
            return None
        return Detection(bounding_box(self.world.points), SCHEME.eye_centers(self.world.points), 0.9)


class Rig:
    """A tracker in a world."""

    def __init__(self, check_every: int = 10) -> None:
        self.world = World()
        self.network, self.detector = FakeNetwork(self.world), FakeDetector(self.world)
        self.tracker = LandmarkTracker("fake", self.network, self.detector, check_every=check_every)  # type: ignore[arg-type]
        self.index = 0

    def step(self, image: np.ndarray = IMAGE) -> tuple[FaceStatus, float]:
        """The next frame's status and the error of its landmarks in eye spans."""
        state = self.tracker.track(Frame(image, self.index, 0.0, self.index / 30))
        self.index += 1
        if not state.visible or self.world.points is None:
            return state.status, 0.0
        return state.status, float(np.linalg.norm(state.landmarks - self.world.points, axis=1).mean() / EYE_SPAN)


def test_it_measures_what_it_finds() -> None:
    rig = Rig()
    state = rig.tracker.track(Frame(IMAGE, 0, 0.0, 0.0))
    assert state.status is FaceStatus.FOUND
    assert state.scheme == rig.tracker.scheme == SCHEME.name
    np.testing.assert_array_equal(state.landmarks, FACE)
    assert state.pose is not None
    np.testing.assert_allclose(state.pose.translation, (0, 0, -80), atol=0.05)
    assert state.mouth == SCHEME.mouth_opening(FACE)
    assert state.eyes == SCHEME.eyes_opening(FACE)
    assert state.blendshapes == {"jawOpen": 0.25}
    assert state.confidence == pytest.approx(0.99)


def test_the_detector_is_asked_to_begin_and_then_every_few_frames() -> None:
    rig = Rig(check_every=5)
    for _ in range(11):
        assert rig.step() == (FaceStatus.FOUND, 0)
    assert (rig.detector.calls, rig.detector.nearby_calls) == (1, 2)


def test_no_face_is_lost_and_searched_in_every_frame() -> None:
    rig = Rig()
    rig.world.points = None
    for _ in range(3):
        assert rig.tracker.track(Frame(IMAGE, 0, 0.0, 0.0)) is LOST
    assert rig.detector.calls == 3
    assert rig.network.reads == 0
    rig.world.points = FACE
    assert rig.step() == (FaceStatus.FOUND, 0)


def test_a_face_that_goes_is_lost_at_once() -> None:
    rig = Rig()
    rig.step()
    rig.world.points = None
    assert rig.step()[0] is FaceStatus.LOST


def test_after_a_large_motion_it_looks_twice_and_has_it_checked() -> None:
    rig = Rig()
    rig.step()
    reads, calls = rig.network.reads, rig.detector.nearby_calls
    rig.world.points = FACE + np.array([0.4 * EYE_SPAN, 0], np.float32)
    assert rig.step() == (FaceStatus.FOUND, 0)
    assert rig.network.reads == reads + 2
    assert rig.detector.nearby_calls == calls + 1


def test_a_mesh_that_slipped_is_seeded_anew_although_it_is_sure() -> None:
    rig = Rig(check_every=3)
    rig.step()
    rig.world.points = FACE + np.array([0, 0.8 * EYE_SPAN], np.float32)
    errors = [rig.step()[1] for _ in range(4)]
    assert errors[-1] == 0


def test_after_a_cut_the_face_is_found_in_the_same_frame_wherever_it_is() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (2, *IMAGE.shape)).astype(np.uint8)
    rig = Rig(check_every=100)
    rig.step(noise[0])
    rig.world.points = FACE + np.array([0, 0.8 * EYE_SPAN], np.float32)
    assert rig.step(noise[1]) == (FaceStatus.FOUND, 0)
    rig.world.points = FACE + np.array([4 * EYE_SPAN, 0], np.float32)
    assert rig.step(noise[0]) == (FaceStatus.FOUND, 0)


def test_another_face_is_taken_over_only_when_the_first_stays_away() -> None:
    rig = Rig(check_every=1)
    rig.step()
    other = FACE + np.array([4 * EYE_SPAN, 0], np.float32)
    rig.detector.detect = lambda image, near=None, besides=(): Detection(  # type: ignore[method-assign]
        bounding_box(other), SCHEME.eye_centers(other), 0.9
    )
    rig.detector.detect_nearby = lambda image, box: None  # type: ignore[method-assign]
    statuses = [rig.step()[0] for _ in range(8)]
    assert statuses == [FaceStatus.UNCERTAIN] * 8
    rig.world.points = other
    assert rig.step() == (FaceStatus.FOUND, 0)


def test_a_face_the_detector_cannot_see_is_uncertain_and_lost_after_a_second() -> None:
    rig = Rig(check_every=5)
    rig.step()
    rig.world.detectable = False
    states = [rig.tracker.track(Frame(IMAGE, index, 0.0, index / 30)) for index in range(50)]
    statuses = [state.status for state in states]
    assert statuses[:4] == [FaceStatus.FOUND] * 4
    assert statuses[4:34] == [FaceStatus.UNCERTAIN] * 30
    assert statuses[34:] == [FaceStatus.LOST] * 16
    assert states[10].confidence == pytest.approx(0.99 / 2)


def test_a_detector_that_sees_again_restores_trust() -> None:
    rig = Rig(check_every=2)
    rig.step()
    rig.world.detectable = False
    assert [rig.step()[0] for _ in range(3)][-1] is FaceStatus.UNCERTAIN
    rig.world.detectable = True
    assert rig.step()[0] is FaceStatus.FOUND


def test_reset_searches_anew() -> None:
    rig = Rig()
    rig.step()
    rig.tracker.reset()
    calls = rig.detector.calls
    rig.step()
    assert rig.detector.calls == calls + 1


def test_eyes_are_not_compared_under_a_large_roll() -> None:
    rig = Rig(check_every=1)
    rolled = face(roll=60, at=(0, 0, -80)).landmarks
    rig.world.points = rolled
    rig.step()
    detect = rig.detector.detect
    # YuNet's eyes are wrong there by more than the tolerance.
    rig.detector.detect = lambda image, near=None, besides=(): Detection(  # type: ignore[method-assign]
        detect(image, near).box, SCHEME.eye_centers(rolled) + np.float32(0.7 * EYE_SPAN), 0.9
    )
    reads = rig.network.reads
    assert rig.step()[0] is FaceStatus.FOUND
    assert rig.network.reads == reads + 1
