"""The faces besides the one that the camera is for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.detection.face_detector import Detection, FaceDetector
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.landmarks.rotated_crop import Crop, bounding_box
from relit_camera.face.motion.face_follower import FaceFollower, FaceMotion
from relit_camera.face.tracking.further_faces import TUNABLES, FurtherFaces
from relit_camera.face.tracking.landmark_tracker import LandmarkPrediction, LandmarkTracker
from tests.face.faces import SCHEME, SIZE, BoxCrops, face

IMAGE = np.random.default_rng(0).integers(0, 255, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
PLACES = {"first": (0, 0, -80), "left": (-24, 2, -95), "right": (24, 2, -100), "behind": (-12, 18, -150)}


class Crowd(BoxCrops, FaceDetector):
    """Who is there, and a detector and a network that see them."""

    def __init__(self, *names: str) -> None:
        self.points = {name: face(at=PLACES[name]).landmarks for name in names}
        self.looks = 0

    def _faces(self, image: DisplayImage) -> list[Detection]:
        self.looks += 1
        return [Detection(bounding_box(each), SCHEME.eye_centers(each), 0.9) for each in self.points.values()]

    def _faces_in_surroundings(self, region: DisplayImage) -> list[Detection]:
        return []  # it has to look at the whole picture

    def read(self, image: np.ndarray, crop: Crop) -> LandmarkPrediction:
        """The face nearest to the crop; nobody where it is far off."""
        away = {name: float(np.linalg.norm(each.mean(axis=0) - crop.center)) for name, each in self.points.items()}
        nearest = min(away, key=lambda name: away[name], default=None)
        if nearest is None or away[nearest] > crop.width:
            return LandmarkPrediction(face(at=(0, 0, -80)).landmarks, 0.01)
        return LandmarkPrediction(self.points[nearest], 0.99)

    def blendshapes(self, points: np.ndarray) -> Mapping[str, float]:
        return {}


class Camera:
    """Frames of a crowd, thirty a second; the tracker is the camera's own."""

    def __init__(self, *names: str) -> None:
        self.crowd = Crowd(*names)
        self.tracker = LandmarkTracker("crowd", self.crowd, self.crowd)
        self.faces = FurtherFaces(self.tracker, lambda: FaceFollower(SCHEME.name))
        self.index = 0

    def frames(self, count: int, image: DisplayImage = IMAGE) -> tuple[FaceState, Mapping[int, FaceMotion]]:
        """What is told in the last of so many more frames."""
        for _ in range(count):
            frame = Frame(image, self.index, 0.0, self.index / 30)
            state = self.tracker.track(frame)
            others = self.faces.follow(frame, state, 2)
            self.index += 1
        return state, others

    def is_at(self, found: FaceState | FaceMotion, name: str) -> bool:
        return float(np.linalg.norm(found.landmarks - self.crowd.points[name], axis=1).mean()) < 1


def test_all_are_followed_from_the_first_frame_each_once() -> None:
    camera = Camera(*PLACES)
    for _ in range(3):
        state, others = camera.frames(20)
        assert camera.is_at(state, "first")
        assert sorted(others) == [1, 2, 3]
        assert all(each.status is FaceStatus.FOUND for each in others.values())
        names = {name for name in PLACES for each in others.values() if camera.is_at(each, name)}
        assert names == {"left", "right", "behind"}


def test_the_picture_is_looked_at_once_a_second_and_never_where_there_is_no_room() -> None:
    alone, full = Camera("first"), Camera(*PLACES)
    alone.frames(91)
    full.frames(91)
    # One look of the camera's own tracker to begin; its checks look too, as nobody is seen nearby.
    checks = 91 // 10
    assert 4 <= alone.crowd.looks - checks <= 6
    assert full.crowd.looks <= 2 + 4 * checks + 4


def test_they_take_turns() -> None:
    camera = Camera(*PLACES)
    before, looked = camera.frames(30)[1], dict.fromkeys((1, 2, 3), 0)
    for _ in range(12):
        now = camera.frames(1)[1]
        for number, motion in now.items():
            looked[number] += motion is not before[number]
        before = now
    assert looked == {1: 4, 2: 4, 3: 4}


def test_who_comes_gets_the_next_number_and_who_goes_is_forgotten() -> None:
    camera = Camera("first")
    assert camera.frames(10)[1] == {}
    camera.crowd.points["left"] = face(at=PLACES["left"]).landmarks
    assert list(camera.frames(round(TUNABLES.look_s * 30) + 1)[1]) == [1]
    del camera.crowd.points["left"]
    others = camera.frames(5)[1]
    assert others[1].status is FaceStatus.LOST
    assert camera.frames(round(TUNABLES.forgotten_s * 30) + 2)[1] == {}
    camera.crowd.points["right"] = face(at=PLACES["right"]).landmarks
    assert list(camera.frames(round(TUNABLES.look_s * 30) + 1)[1]) == [2]


def test_a_face_that_comes_back_keeps_its_number() -> None:
    camera = Camera("first", "left")
    camera.frames(30)
    points = camera.crowd.points.pop("left")
    assert camera.frames(40)[1][1].status is FaceStatus.LOST
    camera.crowd.points["left"] = points
    others = camera.frames(round(TUNABLES.sought_s * 30) + 2)[1]
    assert list(others) == [1]
    assert others[1].status is FaceStatus.FOUND


def test_who_hides_their_face_for_a_moment_is_not_taken_for_another() -> None:
    camera = Camera("first", "left")
    camera.frames(10)
    points = camera.crowd.points.pop("first")
    state, others = camera.frames(20)
    assert not state.visible
    assert camera.is_at(others[1], "left")
    camera.crowd.points["first"] = points
    state, others = camera.frames(2)
    assert camera.is_at(state, "first")
    assert camera.is_at(others[1], "left")


def test_when_the_first_one_has_left_the_camera_is_for_another() -> None:
    camera = Camera("first", "left", "behind")
    camera.frames(10)
    del camera.crowd.points["first"]
    state, others = camera.frames(round(TUNABLES.left_s * 30) + 5)
    assert camera.is_at(state, "left")
    assert len(others) == 1
    assert camera.is_at(next(iter(others.values())), "behind")


def test_whoever_moves_to_where_another_left_stays_who_they_are() -> None:
    camera = Camera("first", "left", "behind")
    followed = camera.frames(10)[1]
    (mover,) = (number for number, each in followed.items() if camera.is_at(each, "behind"))
    del camera.crowd.points["left"]
    camera.frames(10)
    here, there = (face(at=PLACES[name]).landmarks for name in ("behind", "left"))
    for share in np.linspace(0, 1, 40):  # slowly enough to be followed
        camera.crowd.points["behind"] = (here * (1 - share) + there * share).astype(np.float32)
        camera.frames(1)
    others = camera.frames(30)[1]
    assert others[mover].status is FaceStatus.FOUND
    assert camera.is_at(others[mover], "behind")


def test_heads_together_stay_who_they_are() -> None:
    camera = Camera("first", "left")
    camera.frames(10)
    start, near = camera.crowd.points["left"].copy(), camera.crowd.points["first"] - np.array([75, 0], np.float32)
    for share in np.linspace(0, 1, 40):
        camera.crowd.points["left"] = (start * (1 - share) + near * share).astype(np.float32)
        state, _ = camera.frames(1)
        assert state.visible
        assert camera.is_at(state, "first")


def test_turns_are_even_after_coming_and_going() -> None:
    camera = Camera(*PLACES)
    camera.frames(10)
    for name in ("left", "right"):  # two of them leave and come back long after: they have new numbers
        points = camera.crowd.points.pop(name)
        camera.frames(round(TUNABLES.forgotten_s * 30) + 40)
        camera.crowd.points[name] = points
        camera.frames(round(TUNABLES.look_s * 30) + 2)
    before, looked = camera.frames(1)[1], []
    for _ in range(6):
        now = camera.frames(1)[1]
        looked.append(sum(motion is not before[number] for number, motion in now.items()))
        before = now
    assert looked == [1] * 6


def test_while_they_are_forgotten_the_tracker_passes_over_nobody() -> None:
    camera = Camera("first", "left")
    camera.frames(5)
    assert len(camera.tracker.besides) == 1
    camera.faces.release()
    assert camera.tracker.besides == ()
    camera.frames(1)
    assert len(camera.tracker.besides) == 1
    camera.faces.forget()
    assert camera.tracker.besides == ()


def test_a_face_that_is_too_small_is_not_followed() -> None:
    camera = Camera("first")
    camera.crowd.points["far"] = face(at=(60, 0, -900)).landmarks
    assert max(bounding_box(camera.crowd.points["far"])[2:]) < TUNABLES.least_px
    assert camera.frames(40)[1] == {}


def test_a_film_that_begins_again_is_looked_at_anew() -> None:
    camera = Camera("first", "left")
    assert list(camera.frames(30)[1]) == [1]
    camera.index = 0
    assert list(camera.frames(1)[1]) == [2]


class NoLandmarkTracker:
    name, scheme = "another", SCHEME.name

    def track(self, frame: Frame) -> FaceState:
        return face(at=PLACES["first"])

    def reset(self) -> None:
        pass


def test_with_a_tracker_that_cannot_be_shared_there_are_no_others() -> None:
    faces = FurtherFaces(NoLandmarkTracker(), lambda: pytest.fail("nobody is followed"))
    frame = Frame(IMAGE, 0, 0.0, 0.0)
    assert faces.follow(frame, face(at=PLACES["first"]), 1) == {}
