"""The performance, and the truth of driving videos against what projects otherwise."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from relit_camera.face.pose import fit_pose, project
from relit_camera.face.schemes import landmark_scheme
from relit_camera.face.track_file import TrackRecorder, read_track
from relit_camera.light.exposure import display_scale
from relit_camera.light.maps import irradiance
from relit_camera.light.store import EnvironmentStore
from relit_camera.space.images import Frame
from relit_camera.space.rotation import Angles
from relit_studio.camera import Camera
from relit_studio.drive.performance import FPS, FRAMES, frame_times, posture_at
from relit_studio.drive.room import Room
from relit_studio.drive.truth import TruthTracker, blendshapes, head_pose, true_state
from relit_studio.people.expressions import NEUTRAL
from relit_studio.people.eyes import gaze
from relit_studio.people.face_model import CORNEA_MATERIALS
from relit_studio.people.landmarks import landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture, follows_head, rigid_motion, turned

CAMERA = Camera(512)
TURNED = Posture(Angles(22.0, -6.0, 5.0))


def test_the_performance_is_eased_and_stays_within_what_is_asked() -> None:
    postures = [posture_at(time_s) for time_s in frame_times()]
    assert len(postures) == FRAMES == 6 * FPS
    yaw, pitch, roll = np.array([posture.angles for posture in postures]).T
    assert yaw.max() > 25
    assert yaw.min() < -25
    assert np.abs(yaw).max() < 30
    assert np.abs([pitch, roll]).max() < 12
    steps = np.abs(np.diff([yaw, pitch, roll], axis=1))
    assert steps.max() < 4.5  # degrees a frame
    lids = [posture.expression["eyeBlink_L"] for posture in postures]
    assert sum(before < 0.9 <= after for before, after in pairwise(lids)) >= 4
    assert all(0 <= weight <= 1.2 for posture in postures for weight in posture.expression.values())
    for end in (postures[0], posture_at(6.0)):
        np.testing.assert_allclose(end.angles, 0, atol=1e-9)
        assert {name: weight for name, weight in end.expression.items() if weight} == NEUTRAL


def test_the_head_moves_rigidly_and_the_shoulders_stand_still(person: Person) -> None:
    rest, moved = person.vertices(Posture()), person.vertices(TURNED)
    share = follows_head(person.neutral)
    matrix = rigid_motion(TURNED.rotation)
    head, shoulders = share == 1, share == 0
    assert head.sum() > 15_000
    np.testing.assert_allclose(moved[head], rest[head] @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-9)
    np.testing.assert_array_equal(moved[shoulders], rest[shoulders])
    assert (share[person.model.landmarks68] == 1).all()


@pytest.mark.parametrize("scheme", ["mesh478", "openseeface66"])
def test_landmarks_move_with_the_pose_that_is_told(person: Person, scheme: str) -> None:
    upright = landmarks(person, Posture())[scheme]
    state = true_state(person, CAMERA, TURNED, scheme)
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
    for centre, outer, inner in ((468, 33, 133), (473, 263, 362)):
        middle = (mesh[outer] + mesh[inner]) / 2
        assert np.linalg.norm((mesh[centre] - middle)[:2]) < 0.5


def test_lids_and_mouth_open_as_told(person: Person) -> None:
    def state(**weights: float) -> tuple[float, float, float]:
        found = true_state(person, CAMERA, Posture(expression={**NEUTRAL, **weights}))
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
    tracker = TruthTracker(person, CAMERA)
    recorder = TrackRecorder(tracker, (512, 512), FPS)
    picture = np.zeros((512, 512, 3), np.uint8)
    for index in (0, 55, 90):
        recorder.add(tracker.track(Frame(picture, index, 0.0, index / FPS)), index / FPS)
    recorder.write(tmp_path / "track.json")
    track = read_track(tmp_path / "track.json")
    state, posture = track.state(1), posture_at(55 / FPS)
    assert state.pose is not None
    truth = head_pose(person, CAMERA, posture)
    assert (state.pose.rotation * truth.rotation.inv()).magnitude() < 1e-6
    np.testing.assert_allclose(state.pose.translation, truth.translation, atol=1e-6)
    assert state.pose.focal_px == CAMERA.focal_px


def test_a_turned_room_lights_from_where_it_is_seen() -> None:
    environment = EnvironmentStore(Path("/no/such/folder")).load("window")
    room = Room(environment, 90.0)
    straight = Room(environment).light_map
    # A quarter turn to the right: what came from the front comes from the right.
    np.testing.assert_allclose(irradiance(room.light_map, (1, 0, 0)), irradiance(straight, (0, 0, 1)), rtol=0.02)
    assert room.scale == display_scale(room.light_map)
    assert room.backdrop(Camera(64)).shape == (64, 64, 3)
