"""Tracking every n-th frame: what the flow makes of a moving picture, and when it must not be trusted."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import Frame
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.head_pose import fit_pose
from relit_camera.face.tracking.interval_tracker import IntervalTracker
from relit_camera.face.tracking.mediapipe_mesh_tracker import MeshTracker
from relit_camera.face.tracking.trackers import TrackerOptions
from tests.face.faces import SCHEME, SIZE, face
from tests.face.test_lip_regression import mouth

FACE = face(at=(0.0, 0.0, -45.0))
SPAN = SCHEME.eye_span(FACE.landmarks)
CENTER = FACE.landmarks.mean(axis=0)


def blotches(seed: int = 0) -> np.ndarray:
    """A picture with detail of a tenth of the face."""
    noise = np.random.default_rng(seed).normal(0, 1, (SIZE[1], SIZE[0], 3)).astype(np.float32)
    blurred = cv2.GaussianBlur(noise, (0, 0), 14)
    return np.clip(110 + 50 * blurred / blurred.std(), 0, 255).astype(np.uint8)


PICTURE = blotches()


def turned(angle_deg: float, shift: tuple[float, float]) -> np.ndarray:
    """(2, 3): a turn about the face and a shift, for points with pixel centres at integers."""
    affine = cv2.getRotationMatrix2D((float(CENTER[0]), float(CENTER[1])), angle_deg, 1.0)
    affine[:, 2] += shift
    return affine


def moved_face(affine: np.ndarray) -> FaceState:
    points = (FACE.landmarks - 0.5) @ affine[:, :2].T + affine[:, 2] + 0.5
    return state_of(points.astype(np.float32))


def state_of(points: np.ndarray, status: FaceStatus = FaceStatus.FOUND) -> FaceState:
    return FaceState(status, 0.9, SCHEME.name, points, fit_pose(points, SCHEME, SIZE, 640.0))


class TruthTracker:
    """Gives the state that it is told; counts how often it is asked."""

    name = "truth"
    scheme = SCHEME.name

    def __init__(self) -> None:
        self.state = FACE
        self.measured = 0
        self.resets = 0

    def track(self, frame: Frame) -> FaceState:
        self.measured += 1
        return self.state

    def reset(self) -> None:
        self.resets += 1


class Rig:
    """An interval tracker that is shown pictures thirty times a second."""

    def __init__(self, interval: int = 2) -> None:
        self.truth = TruthTracker()
        self.tracker = IntervalTracker(self.truth, interval)
        self.time_s = 0.0

    def show(self, picture: np.ndarray = PICTURE, state: FaceState = FACE, step_s: float = 1 / 30) -> FaceState:
        self.truth.state = state
        self.time_s += step_s
        return self.tracker.track(Frame(picture, 0, self.time_s, self.time_s))


def error(state: FaceState, truth: FaceState) -> float:
    """Root mean square distance of the landmarks in eye spans."""
    return float(np.sqrt((np.linalg.norm(state.landmarks - truth.landmarks, axis=1) ** 2).mean())) / SPAN


@pytest.mark.parametrize("interval", [1, 2, 3])
def test_it_measures_every_nth_frame(interval: int) -> None:
    rig = Rig(interval)
    measured = []
    for _ in range(7):
        before = rig.truth.measured
        rig.show()
        measured.append(rig.truth.measured > before)
    assert measured == [index % interval == 0 for index in range(7)]


def test_an_interval_of_one_gives_the_tracker_s_own_states() -> None:
    rig = Rig(1)
    for _ in range(3):
        assert rig.show() is FACE


@pytest.mark.parametrize(("angle", "shift"), [(0.0, (6.0, -4.0)), (4.0, (0.0, 0.0)), (-3.0, (-8.0, 5.0))])
def test_between_measurements_the_face_follows_the_picture(angle: float, shift: tuple[float, float]) -> None:
    rig = Rig(2)
    rig.show()
    affine = turned(angle, shift)
    truth = moved_face(affine)
    followed = rig.show(cv2.warpAffine(PICTURE, affine, SIZE))
    assert rig.truth.measured == 1
    assert error(FACE, truth) > 0.02
    assert error(followed, truth) < 0.01
    assert followed.status is FaceStatus.FOUND
    assert followed.pose is not None
    assert truth.pose is not None
    np.testing.assert_allclose(
        angles_from_rotation(followed.pose.rotation), angles_from_rotation(truth.pose.rotation), atol=1.0
    )
    assert followed.eyes == SCHEME.eyes_opening(followed.landmarks)
    assert followed.mouth == SCHEME.mouth_opening(followed.landmarks)


def test_flow_is_carried_on_over_several_frames() -> None:
    rig = Rig(4)
    rig.show()
    for index in (1, 2, 3):
        affine = turned(1.0 * index, (4.0 * index, 0.0))
        followed = rig.show(cv2.warpAffine(PICTURE, affine, SIZE))
    assert rig.truth.measured == 1
    assert error(followed, moved_face(affine)) < 0.015


def test_the_chin_moves_by_itself() -> None:
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float32)
    chin = FACE.landmarks[8] - np.array([0.0, 10.0])
    reach = 0.45 * SPAN
    weight = np.exp(-((columns - chin[0]) ** 2 + (rows - chin[1]) ** 2) / (2 * reach**2))
    drop = 0.06 * SPAN
    lower = (rows - drop * weight).astype(np.float32)
    picture = cv2.remap(PICTURE, columns, lower, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    rig = Rig(2)
    rig.show()
    moved = rig.show(picture).landmarks - FACE.landmarks
    assert rig.truth.measured == 1
    assert moved[8, 1] == pytest.approx(drop, rel=0.3)
    assert abs(moved[27, 1]) < 0.15 * drop  # between the eyes


def talking(gap_cm: float) -> tuple[np.ndarray, FaceState]:
    """The picture with a drawn mouth, open by so much, and the face in it."""
    drawn, landmarks = mouth(gap_cm)
    return cv2.addWeighted(drawn, 0.6, PICTURE, 0.4, 0), state_of(landmarks)


def test_a_talking_mouth_is_seen_to_open_between_measurements() -> None:
    rig, gaps, errors, motions = Rig(2), 0.8 + 0.7 * np.sin(np.arange(90) * 0.5), [], []
    for index, gap in enumerate(gaps):
        before = rig.truth.measured
        picture, truth = talking(gap)
        state = rig.show(picture, truth)
        if index > 45 and rig.truth.measured == before:
            errors.append(SCHEME.mouth_opening(state.landmarks) - SCHEME.mouth_opening(truth.landmarks))
            held = talking(gaps[index - 1])[1]
            motions.append(SCHEME.mouth_opening(held.landmarks) - SCHEME.mouth_opening(truth.landmarks))
            assert state.mouth == SCHEME.mouth_opening(state.landmarks)
    assert len(errors) > 15
    assert np.std(errors) < 0.4 * np.std(motions)


@pytest.mark.parametrize("status", [FaceStatus.UNCERTAIN, FaceStatus.LOST])
def test_a_face_that_is_not_certain_is_measured_in_every_frame(status: FaceStatus) -> None:
    rig = Rig(3)
    uncertain = LOST if status is FaceStatus.LOST else state_of(FACE.landmarks, status)
    for _ in range(4):
        assert rig.show(state=uncertain) is uncertain
    assert rig.truth.measured == 4


def test_after_a_cut_the_frame_is_measured() -> None:
    rig = Rig(2)
    rig.show()
    other = moved_face(turned(0, (40, 0)))
    assert rig.show(blotches(seed=1), other) is other


def test_after_a_jump_the_frame_is_measured() -> None:
    rig = Rig(2)
    rig.show()
    affine = turned(0, (0.8 * SPAN, 0))
    truth = moved_face(affine)
    assert rig.show(cv2.warpAffine(PICTURE, affine, SIZE), truth) is truth


@pytest.mark.parametrize("step_s", [-1.0, 0.0, 0.5])
def test_time_that_goes_back_stands_still_or_jumps_is_measured(step_s: float) -> None:
    rig = Rig(2)
    rig.show()
    rig.show(step_s=step_s)
    assert rig.truth.measured == 2


def test_a_picture_of_another_size_is_measured() -> None:
    rig = Rig(2)
    rig.show()
    rig.show(PICTURE[:400])
    assert rig.truth.measured == 2


@pytest.mark.parametrize(
    "shift", [(-0.8 * SIZE[0], 0), (0.45 * SIZE[0], 0), (0.45 * SIZE[0], 0.45 * SIZE[1]), (0, 3 * SIZE[1])]
)
def test_a_face_at_the_border_or_beyond_is_no_trouble(shift: tuple[float, float]) -> None:
    rig = Rig(2)
    far = state_of((FACE.landmarks + np.array(shift)).astype(np.float32))
    for _ in range(4):
        assert np.isfinite(rig.show(state=far).landmarks).all()


@pytest.mark.parametrize("scale", [0.001, 0.05, 5.0])
def test_faces_of_any_size_are_no_trouble(scale: float) -> None:
    rig = Rig(2)
    scaled = state_of(((FACE.landmarks - CENTER) * scale + CENTER).astype(np.float32))
    for _ in range(4):
        assert error(rig.show(state=scaled), scaled) < 0.001


def test_a_picture_without_detail_is_measured() -> None:
    rig = Rig(2)
    flat = np.full_like(PICTURE, 90)
    rig.show(flat)
    rig.show(flat)
    assert rig.truth.measured == 2


def test_the_interval_changes_while_it_runs() -> None:
    rig = Rig(1)
    rig.show()
    rig.tracker.set_interval(2)
    assert rig.tracker.interval == 2
    for _ in range(4):
        rig.show()
    assert rig.truth.measured == 1 + 2
    rig.tracker.set_interval(1)
    for _ in range(3):
        rig.show()
    assert rig.truth.measured == 3 + 3


def test_an_interval_below_one_is_refused() -> None:
    with pytest.raises(InputError, match="every 0 frames"):
        IntervalTracker(TruthTracker(), 0)
    with pytest.raises(InputError, match="every -1 frames"):
        Rig().tracker.set_interval(-1)


def test_reset_forgets_the_face() -> None:
    rig = Rig(2)
    rig.show()
    resets = rig.truth.resets
    rig.tracker.reset()
    assert rig.truth.resets == resets + 1
    rig.show()
    assert rig.truth.measured == 2


def test_a_real_face_is_followed_as_the_network_measures_it(face_models: Path, portrait: np.ndarray) -> None:
    height, width = portrait.shape[:2]
    options = TrackerOptions(blendshapes=False)
    each, half = MeshTracker(options), IntervalTracker(MeshTracker(options), 2)
    errors = []
    for index in range(8):
        affine = cv2.getRotationMatrix2D((width / 2, height / 2), 1.5 * index, 1 + 0.01 * index)
        affine[:, 2] += (2 * index, -index)
        frame = Frame(cv2.warpAffine(portrait, affine, (width, height)), index, index / 30, index / 30)
        truth, state = each.track(frame), half.track(frame)
        span = np.linalg.norm(truth.landmarks[33] - truth.landmarks[263])
        errors.append(np.sqrt((np.linalg.norm(state.landmarks - truth.landmarks, axis=1) ** 2).mean()) / span)
    assert max(errors[1::2]) < 0.012
    assert max(errors[1::2]) > 0  # followed, not measured
