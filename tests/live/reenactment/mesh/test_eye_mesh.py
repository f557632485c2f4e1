"""Eyes of the mesh: lids meet where trackers leave a gap, and hide the eyeball, which stays as it is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.live.reenactment.mesh.eye_mesh import AS_SEEN, SHUT, EyeMesh, eye_mesh
from tests.live.people import SCHEME, face_of, person


@pytest.fixture(params=["right_eye", "left_eye"])
def eye(request: pytest.FixtureRequest) -> EyeMesh:
    return eye_mesh(face_of(person()), getattr(SCHEME, request.param))


def lowered(eye: EyeMesh, opening: float) -> NDArray[np.float64]:
    """The landmarks of the source image with the upper lid let down: to the lower one with `opening` 0."""
    moved = eye.source.copy()
    moved[eye.upper] += (1 - opening) * (moved[eye.lower] - moved[eye.upper])
    return moved


def shut(eye: EyeMesh, landmarks: NDArray[np.float64]) -> NDArray[np.float64]:
    changed = landmarks.copy()
    eye.shut(changed)
    return changed


@pytest.mark.parametrize("opening", [1.3, 1.0, 0.5, 0.0])
def test_the_opening_is_that_of_the_source_image_where_it_is_1(eye: EyeMesh, opening: float) -> None:
    assert eye.opening(lowered(eye, opening)) == pytest.approx(opening, abs=1e-9)


@pytest.mark.parametrize("opening", [0.9 * SHUT, 0.5 * SHUT, 0.0, -0.2])
def test_lids_that_nearly_meet_or_have_crossed_meet(eye: EyeMesh, opening: float) -> None:
    landmarks = shut(eye, lowered(eye, opening))
    down = np.array([0.0, 1.0])
    np.testing.assert_allclose((landmarks[eye.upper] - landmarks[eye.lower]) @ down, 0, atol=0.05 * eye.gap)
    assert eye.opening(landmarks) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("opening", [AS_SEEN, 1.0, 1.2])
def test_open_eyes_are_as_open_as_they_are_seen(eye: EyeMesh, opening: float) -> None:
    landmarks = lowered(eye, opening)
    np.testing.assert_allclose(shut(eye, landmarks), landmarks, atol=1e-9)


def test_nothing_but_the_lids_moves_and_the_upper_one_most(eye: EyeMesh) -> None:
    landmarks = lowered(eye, 0.3)
    moved = np.linalg.norm(shut(eye, landmarks) - landmarks, axis=1)
    assert set(np.flatnonzero(moved)) <= {*eye.upper.tolist(), *eye.lower.tolist()}
    assert (moved[eye.upper] > 3 * moved[eye.lower]).all()


def test_an_eye_shuts_evenly(eye: EyeMesh) -> None:
    seen = np.linspace(0, 1, 101)
    shown = np.array([eye.opening(shut(eye, lowered(eye, each))) for each in seen])
    assert (np.diff(shown) >= -1e-9).all()
    assert np.diff(shown).max() < 0.04
    closing = np.array([eye.closing(lowered(eye, each)) for each in seen])
    assert closing[0] == 1
    assert closing[-1] == 0
    assert np.abs(np.diff(closing)).max() < 0.08


def test_an_eye_that_does_not_move_looks_at_itself(eye: EyeMesh) -> None:
    moved, looks = eye.eyeball(eye.source)
    # Corners and lids lie on the outline; the middle of the fan inside it.
    np.testing.assert_allclose(looks, moved, atol=0.02 * eye.gap)


def test_a_lid_that_falls_hides_the_eyeball_and_does_not_squeeze_it(eye: EyeMesh) -> None:
    landmarks = lowered(eye, 0.5)
    moved, looks = eye.eyeball(landmarks)
    inner = (moved[:, 1] != landmarks[eye.corners[0]]).any(axis=1) & (moved[:, 1] != landmarks[eye.corners[1]]).any(1)
    np.testing.assert_allclose(looks[inner, 1], moved[inner, 1], atol=0.1 * eye.gap)


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
    np.testing.assert_allclose(turned, still, atol=0.01 * eye.gap)
