"""The truth of driving videos against what projects otherwise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.images.image_types import Frame
from relit_camera.base.rotations import Angles
from relit_camera.face.head_pose import fit_pose, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.track_recording import TrackRecorder, read_track
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import irradiance
from relit_studio.cameras.studio_camera import Camera
from relit_studio.drive.performance import FPS, ActorState
from relit_studio.drive.performances.away import AWAY
from relit_studio.drive.performances.hands import HANDS
from relit_studio.drive.performances.talk import TALK
from relit_studio.drive.room import Room
from relit_studio.drive.take import Take
from relit_studio.drive.true_tracker import TruthTracker, blendshapes, frame_truth, head_pose, true_state
from relit_studio.people.face.expressions import NEUTRAL
from relit_studio.people.face.eyes import gaze
from relit_studio.people.face.face_model import CORNEA_MATERIALS
from relit_studio.people.face.landmarks import landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture, follows_head, rigid_motion, turned

CAMERA = Camera(512)
TURNED = Posture(Angles(22.0, -6.0, 5.0))


def test_the_head_moves_rigidly_and_the_shoulders_stand_still(person: Person) -> None:
    rest, moved = person.vertices(Posture()), person.vertices(TURNED)
    fraction = follows_head(person.neutral)
    matrix = rigid_motion(TURNED.rotation)
    head, shoulders = fraction == 1, fraction == 0
    assert head.sum() > 15_000
    np.testing.assert_allclose(moved[head], rest[head] @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-9)
    np.testing.assert_array_equal(moved[shoulders], rest[shoulders])
    assert (fraction[person.model.landmarks68] == 1).all()


@pytest.mark.parametrize("scheme", ["mesh478", "openseeface66"])
def test_landmarks_move_with_the_pose_that_is_told(person: Person, scheme: str) -> None:
    upright = landmarks(person, Posture())[scheme]
    state = true_state(Take(person, TALK, CAMERA), ActorState(TURNED), scheme)
    np.testing.assert_allclose(state.landmarks, CAMERA.project(turned(upright, TURNED.rotation)), atol=1e-3)
    assert state.pose is not None
    np.testing.assert_allclose(state.pose.rotation.as_matrix(), TURNED.rotation.as_matrix())
    # The canonical face, placed by the pose, lies on this person's face as well as a mean face can.
    placed = project(landmark_scheme(scheme).canonical, state.pose, (512, 512))
    span = landmark_scheme(scheme).eye_span(state.landmarks)
    assert np.linalg.norm(placed - state.landmarks, axis=1).mean() < 0.09 * span


def test_a_pose_fitted_to_the_landmarks_turns_as_told(person: Person) -> None:
    scheme = landmark_scheme("mesh478")
    fitted = []
    for posture in (Posture(), TURNED):
        points = CAMERA.project(landmarks(person, posture)["mesh478"])
        pose = fit_pose(points, scheme, (512, 512), CAMERA.focal_px)
        assert pose is not None
        fitted.append(pose.rotation)
    apart = (fitted[1] * fitted[0].inv()) * TURNED.rotation.inv()
    assert np.degrees(apart.magnitude()) < 2.5


def test_both_schemes_agree_where_they_name_the_same(person: Person) -> None:
    points = landmarks(person, Posture())
    mesh, ibug = points["mesh478"], points["openseeface66"]
    for vertex, index in ((33, 36), (133, 39), (362, 42), (263, 45), (1, 30), (4, 30)):
        assert np.linalg.norm(mesh[vertex] - ibug[index]) < 1.0
    # Irises lie between their eye's corners, before the rest.
    for center, outer, inner in ((468, 33, 133), (473, 263, 362)):
        middle = (mesh[outer] + mesh[inner]) / 2
        assert np.linalg.norm((mesh[center] - middle)[:2]) < 0.5


def test_lids_and_mouth_open_as_told(person: Person) -> None:
    take = Take(person, TALK, CAMERA)

    def state(**weights: float) -> tuple[float, float, float]:
        found = true_state(take, ActorState(Posture(expression={**NEUTRAL, **weights})))
        return (*found.eyes, found.mouth)

    right, left, mouth = state()
    assert min(right, left) > 0.2
    assert mouth < 0.05
    shut_right = state(eyeBlink_R=1.0, eyeWide_R=0.0)
    assert shut_right[0] < 0.1 < shut_right[1]
    assert state(jawOpen=0.5)[2] > mouth + 0.1


def test_eyes_turn_toward_what_is_told(person: Person) -> None:
    face = person.face({"eyeLookOut_L": 0.5, "eyeLookIn_R": 0.5, "eyeLookDown_L": 0.4})
    model = person.model
    for material, pitch in zip(CORNEA_MATERIALS, (12, 0), strict=True):
        shell = np.unique(model.faces[model.face_material == material])
        shell = shell[shell >= 0]
        before, after = (gaze(vertices[shell])[1] for vertices in (person.face({}), face))
        turned_by = np.degrees([np.arctan2(*a[[0, 2]]) - np.arctan2(*b[[0, 2]]) for a, b in [(after, before)]])
        assert abs(turned_by - 15) < 3
        assert abs(np.degrees(np.arcsin(before[1]) - np.arcsin(after[1])) - pitch) < 3


def test_weights_get_the_names_that_others_use() -> None:
    named = blendshapes({"eyeBlink_L": 0.4, "browInnerUp_L": 0.2, "browInnerUp_R": 0.6, "jawOpen": 1.2})
    assert named == {"eyeBlinkLeft": 0.4, "browInnerUp": 0.4, "jawOpen": 1.0}


def test_a_recorded_track_says_the_truth(person: Person, tmp_path: Path) -> None:
    tracker = TruthTracker(Take(person, TALK, CAMERA))
    recorder = TrackRecorder(tracker, (512, 512), FPS)
    picture = np.zeros((512, 512, 3), np.uint8)
    for index in (0, 55, 90):
        recorder.add(tracker.track(Frame(picture, index, 0.0, index / FPS)), index / FPS)
    recorder.write(tmp_path / "track.json")
    track = read_track(tmp_path / "track.json")
    state, moment = track.state(1), TALK.state_at(55 / FPS)
    assert state.pose is not None
    truth = head_pose(person, CAMERA, moment)
    assert (state.pose.rotation * truth.rotation.inv()).magnitude() < 1e-6
    np.testing.assert_allclose(state.pose.translation, truth.translation, atol=1e-6)
    assert state.pose.focal_px == CAMERA.focal_px


def test_who_moves_aside_takes_landmarks_and_pose_along(person: Person) -> None:
    take, shift = Take(person, TALK, CAMERA), (4.0, -2.0, -6.0)
    at_rest, aside = (true_state(take, ActorState(TURNED, shift_cm)) for shift_cm in ((0.0, 0.0, 0.0), shift))
    points = landmarks(person, TURNED)["mesh478"] + shift
    np.testing.assert_allclose(aside.landmarks, CAMERA.project(points), atol=1e-3)
    assert at_rest.pose is not None
    assert aside.pose is not None
    moved = aside.pose.translation - at_rest.pose.translation
    np.testing.assert_allclose(moved / np.linalg.norm(moved), np.array(shift) / np.linalg.norm(shift), atol=1e-9)


def test_nobody_is_found_while_nobody_is_there(person: Person, tmp_path: Path) -> None:
    take = Take(person, AWAY, Camera(180, 320))
    tracker, times = TruthTracker(take), (0.0, 3.0, 5.9)
    recorder = TrackRecorder(tracker, (320, 180), FPS)
    for index, time_s in enumerate(times):
        recorder.add(tracker.track(Frame(np.zeros((180, 320, 3), np.uint8), index, 0.0, time_s)), time_s)
    recorder.write(tmp_path / "track.json")
    assert [frame.found for frame in read_track(tmp_path / "track.json").frames] == [True, False, True]
    truths = [frame_truth(take, time_s) for time_s in times]
    assert [truth["found"] for truth in truths] == [True, False, True]
    assert [truth["visible_share"] for truth in truths] == [1, 0, 1]
    assert [len(truth["landmarks66_hidden"]) for truth in truths] == [0, 66, 0]


@pytest.mark.slow
def test_a_raised_mug_covers_the_mouth_and_not_the_eyes(person: Person) -> None:
    take = Take(person, HANDS, CAMERA)
    at_rest, raised, drinking, passing = (frame_truth(take, time_s) for time_s in (0.0, 1.55, 2.4, 6.0))
    assert at_rest["covered_share"] == 0
    assert at_rest["landmarks66_hidden"] == []
    assert 0 < raised["covered_share"] < drinking["covered_share"] < 0.6
    mouth, eyes = set(range(48, 66)), set(range(36, 48))
    assert mouth <= set(drinking["landmarks66_hidden"])
    assert not eyes & set(drinking["landmarks66_hidden"])
    assert passing["covered_share"] > 0.3
    for truth in (at_rest, raised, drinking, passing):
        assert truth["visible_share"] == pytest.approx(1 - truth["covered_share"], abs=1e-3)


def test_a_turned_room_lights_from_where_it_is_seen() -> None:
    environment = EnvironmentStore(Path("/no/such/folder")).load("window")
    room = Room(environment, 90.0)
    straight = Room(environment).light_map
    # A quarter turn to the right: what came from the front comes from the right.
    np.testing.assert_allclose(irradiance(room.light_map, (1, 0, 0)), irradiance(straight, (0, 0, 1)), rtol=0.02)
    assert room.scale == auto_exposure_scale(room.light_map)
    assert room.backdrop(Camera(64)).shape == (64, 64, 3)
