"""Eyes of the mesh: lids meet where trackers leave a gap, and hide the eyeball, which stays as it is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.live.reenactment.mesh.eye_mesh import AS_SEEN, CLOSING, SHUT, EyeMesh, eye_mesh
from relit_camera.live.reenactment.motion_transfer import rotate_about
from tests.live.people import SCHEME, face_of, person


@pytest.fixture(params=["right_eye", "left_eye"])
def eye(request: pytest.FixtureRequest) -> EyeMesh:
    return eye_mesh(face_of(person()), getattr(SCHEME, request.param))


def gap(eye: EyeMesh) -> float:
    """Mean height of the eye in the source image, pixels."""
    return float((eye.source[eye.lower, 1] - eye.source[eye.upper, 1]).mean())


def lowered(eye: EyeMesh, opening: float, pose: HeadPose | None = None) -> NDArray[np.float64]:
    """Landmarks with the upper lid let down: to the lower one with `opening` 0."""
    moved = project(eye.face.head_points, pose or eye.face.pose, eye.face.size).astype(np.float64)
    moved[eye.upper] += (1 - opening) * (moved[eye.lower] - moved[eye.upper])
    return moved


def met(eye: EyeMesh, landmarks: NDArray[np.float64], pose: HeadPose | None = None) -> NDArray[np.float64]:
    changed = landmarks.copy()
    eye.meet_lids(changed, pose or eye.face.pose)
    return changed


@pytest.mark.parametrize("angles", [(0, 0, 0), (0, 35, 0), (0, -35, 0), (30, 15, 10), (-30, -15, -20)])
@pytest.mark.parametrize("opening", [1.3, 1.0, 0.5, 0.0])
def test_the_opening_is_that_of_the_lids_however_the_head_is_turned(
    eye: EyeMesh, opening: float, angles: tuple[float, float, float]
) -> None:
    """A nod makes an eye look lower, and does not shut it."""
    pose = rotate_about(np.zeros(3), eye.face.pose, rotation_from_angles(*angles))
    assert eye.opening(lowered(eye, opening, pose), pose) == pytest.approx(opening, abs=1e-3)


@pytest.mark.parametrize("opening", [0.9 * SHUT, 0.5 * SHUT, 0.0, -0.2])
def test_lids_that_nearly_meet_or_have_crossed_meet(eye: EyeMesh, opening: float) -> None:
    landmarks = met(eye, lowered(eye, opening))
    np.testing.assert_allclose(landmarks[eye.upper, 1], landmarks[eye.lower, 1], atol=0.05 * gap(eye))
    assert eye.opening(landmarks, eye.face.pose) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("opening", [AS_SEEN + 1e-3, 1.0, 1.2])
def test_open_eyes_are_as_open_as_they_are_seen(eye: EyeMesh, opening: float) -> None:
    landmarks = lowered(eye, opening)
    np.testing.assert_array_equal(met(eye, landmarks), landmarks)


def test_nothing_but_the_lids_moves_and_the_upper_one_most(eye: EyeMesh) -> None:
    landmarks = lowered(eye, 0.3)
    moved = np.linalg.norm(met(eye, landmarks) - landmarks, axis=1)
    assert set(np.flatnonzero(moved)) <= {*eye.upper.tolist(), *eye.lower.tolist()}
    assert (moved[eye.upper] > 3 * moved[eye.lower]).all()
    assert (moved[eye.lower] > 0).all()


def test_an_eye_shuts_evenly(eye: EyeMesh) -> None:
    pose, seen = eye.face.pose, np.linspace(0, 1, 101)
    shown = np.array([eye.opening(met(eye, lowered(eye, each)), pose) for each in seen])
    assert (np.diff(shown) >= -1e-9).all()
    assert np.diff(shown).max() < 0.04
    closing = np.array([eye.meet_lids(lowered(eye, each), pose) for each in seen])
    assert closing[0] == 1
    assert closing[-1] == 0
    assert np.abs(np.diff(closing)).max() < 0.16
    # It is that of the lids where they are drawn, not of those that were seen.
    np.testing.assert_allclose(closing, smoothstep(shown, *CLOSING), atol=1e-9)


def test_of_an_eye_that_is_shut_in_the_source_image_noise_is_no_opening(eye: EyeMesh) -> None:
    points = eye.face.head_points.copy()
    points[eye.upper] = points[eye.lower]
    landmarks = project(points, eye.face.pose, eye.face.size).astype(np.float32)
    shut = dataclasses.replace(eye, face=dataclasses.replace(eye.face, head_points=points, landmarks=landmarks))
    noisy = landmarks.astype(np.float64)
    noisy[eye.upper, 1] -= 0.002 * np.ptp(eye.source[eye.corners, 0])
    assert shut.opening(landmarks.astype(np.float64), shut.face.pose) == pytest.approx(0, abs=1e-3)
    assert 0 < shut.opening(noisy, shut.face.pose) < 0.1


def test_an_eye_that_does_not_move_looks_at_itself(eye: EyeMesh) -> None:
    moved, looks = eye.eyeball(eye.source)
    np.testing.assert_allclose(looks, moved, atol=0.02 * gap(eye))


def test_a_lid_that_falls_hides_the_eyeball_and_does_not_squeeze_it(eye: EyeMesh) -> None:
    landmarks = lowered(eye, 0.5)
    moved, looks = eye.eyeball(landmarks)
    inner = (moved[:, 1] != landmarks[eye.corners[0]]).any(axis=1) & (moved[:, 1] != landmarks[eye.corners[1]]).any(1)
    np.testing.assert_allclose(looks[inner, 1], moved[inner, 1], atol=0.1 * gap(eye))


def test_an_eye_opened_further_than_in_the_source_image_shows_no_skin(eye: EyeMesh) -> None:
    _, looks = eye.eyeball(lowered(eye, 1.5))
    tops, bottoms = eye.source[eye.upper, 1], eye.source[eye.lower, 1]
    assert looks[..., 1].min() >= tops.min() - 1e-6
    assert looks[..., 1].max() <= bottoms.max() + 1e-6


def test_the_eyeball_goes_along_with_the_corners_of_the_eye(eye: EyeMesh) -> None:
    """Moved and turned as a whole, it looks where it looked."""
    angle = np.radians(12)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    _, still = eye.eyeball(lowered(eye, 0.6))
    _, turned = eye.eyeball(lowered(eye, 0.6) @ turn.T + [5, -3])
    np.testing.assert_allclose(turned, still, atol=0.01 * gap(eye))


def test_what_an_eye_looks_at_lies_in_its_surroundings(eye: EyeMesh) -> None:
    left, top, right, bottom = eye.surroundings
    lids = eye.source[eye.lids]
    width = float(np.ptp(lids[:, 0]))
    assert left < lids[:, 0].min() - 0.5 * width
    assert right > lids[:, 0].max() + 0.5 * width
    assert top < lids[:, 1].min() - 0.5 * width
    assert bottom > lids[:, 1].max() + 0.5 * width
