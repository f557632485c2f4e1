"""What light has left in a face's color is taken out; what differs for other reasons stays."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.instant.skin.even_sides import TUNABLES, even_sides, mirrored_landmarks
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from tests.capture.instant.canonical_person import SIZE, canonical_landmarks, canonical_pose, person_matte

SCHEME = landmark_scheme("mesh478")
LANDMARKS = canonical_landmarks(canonical_pose())
MATTE = person_matte()
SKIN = np.array([0.4, 0.26, 0.2], np.float32)
COLUMNS = np.arange(SIZE) + 0.5 - SIZE / 2


def face() -> NDArray[np.bool_]:
    hull = cv2.convexHull(np.round(LANDMARKS).astype(np.int32))
    return np.asarray(cv2.fillConvexPoly(np.zeros((SIZE, SIZE), np.uint8), hull, 1) > 0)


def body() -> NDArray[np.bool_]:
    """Shoulders, well off their edges and the face."""
    below = np.arange(SIZE)[:, None] > SIZE * 0.88
    return np.asarray((cv2.erode(MATTE, np.ones((9, 9))) > 0.5) & below)


def colored(left: float = 1.0, right: float = 1.0) -> NDArray[np.float32]:
    """Skin all over, by a factor brighter at either side of the picture."""
    across = np.clip(COLUMNS / (0.15 * SIZE), -1, 1)
    factor = np.exp(np.interp(across, [-1, 1], np.log([left, right]))).astype(np.float32)
    return np.broadcast_to(SKIN, (SIZE, SIZE, 3)) * factor[None, :, None]


def factor_of(albedo: NDArray[np.float32]) -> NDArray[np.float32]:
    return even_sides(albedo, face(), MATTE, LANDMARKS, SCHEME)


def test_each_landmark_has_a_mirror_image() -> None:
    mirror = mirrored_landmarks(SCHEME)
    np.testing.assert_array_equal(mirror[mirror], np.arange(SCHEME.count))
    assert (SCHEME.canonical[mirror, 0] * SCHEME.canonical[:, 0] <= 0).all()
    assert (mirror == np.arange(SCHEME.count)).sum() > 10


def test_a_face_that_is_alike_stays() -> None:
    np.testing.assert_allclose(factor_of(colored()), 1, atol=1e-3)


@pytest.mark.parametrize(("left", "right"), [(1.6, 0.6), (0.5, 1.5)])
def test_a_side_that_is_brighter_is_evened_out_and_the_neck_and_body_with_it(left: float, right: float) -> None:
    albedo = colored(left, right)
    evened = albedo * factor_of(albedo)
    expected = SKIN * np.sqrt(left * right)
    for part in (cv2.erode(face().astype(np.uint8), np.ones((5, 5))) > 0, body()):
        before, after = (np.abs(np.log(each[part] / expected)).mean() for each in (albedo, evened))
        assert before > 0.2
        assert after < 0.25 * before


def test_each_channel_is_evened_out_by_itself() -> None:
    albedo = colored()
    albedo[..., 0], albedo[..., 2] = colored(1.8, 0.6)[..., 0], colored(0.6, 1.8)[..., 2]
    evened = (albedo * factor_of(albedo))[face()]
    color = evened / evened.sum(axis=1, keepdims=True)
    assert (color.std(axis=0) < 0.25 * (albedo[face()] / albedo[face()].sum(axis=1, keepdims=True)).std(axis=0)).all()


def test_clothes_of_two_colors_stay_where_the_light_is_even() -> None:
    albedo = colored()
    jacket = body() & (COLUMNS < 0)[None]
    albedo[jacket] = [0.03, 0.03, 0.1]
    np.testing.assert_allclose(factor_of(albedo)[body()], 1, atol=0.02)


def test_clothes_are_corrected_no_further_than_the_light_says() -> None:
    albedo = colored(1.4, 1 / 1.4)
    albedo[body() & (COLUMNS > 0)[None]] = [0.02, 0.02, 0.02]
    factor = factor_of(albedo)[body()]
    assert np.abs(np.log(factor)).max() <= TUNABLES.beside * np.log(1.4) + 0.05
    albedo = colored(1.4, 1 / 1.4)
    albedo[body() & (COLUMNS < 0)[None]] = [0.02, 0.02, 0.02]  # dark where the light is: no light made it so
    factor = factor_of(albedo)
    assert factor[body() & (COLUMNS < -0.2 * SIZE)[None]].max() < 1.1
    assert factor[body() & (COLUMNS > 0.2 * SIZE)[None]].min() > 0.9


def test_a_mole_stays() -> None:
    albedo = colored()
    column, row = LANDMARKS[280].astype(int)  # a cheek
    cv2.circle(albedo, (int(column), int(row)), 1, (0.1, 0.05, 0.04), -1)
    factor = factor_of(albedo)
    assert 0.8 < factor[row, column].min() <= factor.max() < 1.25


def test_without_skin_on_both_sides_nothing_changes() -> None:
    skin = face() & (COLUMNS < -3)[None]
    np.testing.assert_array_equal(even_sides(colored(2, 0.5), skin, MATTE, LANDMARKS, SCHEME), 1)
