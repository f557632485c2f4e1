"""What light has left in a face's color is taken out; what differs for other reasons stays."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.capture.instant.skin.even_sides import even_sides, mirrored_landmarks
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
    return even_sides(albedo, face(), LANDMARKS, SCHEME)


def test_each_landmark_has_a_mirror_image() -> None:
    mirror = mirrored_landmarks(SCHEME)
    np.testing.assert_array_equal(mirror[mirror], np.arange(SCHEME.count))
    assert (SCHEME.canonical[mirror, 0] * SCHEME.canonical[:, 0] <= 0).all()
    assert (mirror == np.arange(SCHEME.count)).sum() > 10


def test_a_face_that_is_alike_stays() -> None:
    np.testing.assert_allclose(factor_of(colored()), 1, atol=1e-3)


@pytest.mark.parametrize(("left", "right"), [(1.6, 0.6), (0.5, 1.5)])
def test_a_side_that_is_brighter_is_evened_out_and_the_neck_with_it(left: float, right: float) -> None:
    albedo = colored(left, right)
    evened = albedo * factor_of(albedo)
    expected = SKIN * np.sqrt(left * right)
    inside = cv2.erode(face().astype(np.uint8), np.ones((5, 5))) > 0
    chin = int(LANDMARKS[:, 1].max())
    neck = np.zeros_like(inside)
    neck[chin + 1 : chin + 8, SIZE // 2 - 14 : SIZE // 2 + 14] = True
    for part, left_over in ((inside, 0.25), (neck, 0.5)):
        before, after = (np.abs(np.log(each[part] / expected)).mean() for each in (albedo, evened))
        assert before > 0.15
        assert after < left_over * before


def test_each_channel_is_evened_out_by_itself() -> None:
    albedo = colored()
    albedo[..., 0], albedo[..., 2] = colored(1.8, 0.6)[..., 0], colored(0.6, 1.8)[..., 2]
    evened = (albedo * factor_of(albedo))[face()]
    color = evened / evened.sum(axis=1, keepdims=True)
    assert (color.std(axis=0) < 0.25 * (albedo[face()] / albedo[face()].sum(axis=1, keepdims=True)).std(axis=0)).all()


def half_fringe() -> NDArray[np.bool_]:
    """Dark hair over one half of the forehead."""
    brow = LANDMARKS[[*SCHEME.left_brow], 1].min()
    return np.asarray(face() & (np.arange(SIZE)[:, None] < brow) & (COLUMNS > 0)[None])


def mark() -> NDArray[np.bool_]:
    """A birthmark of a seventh of the face's width on one cheek."""
    column, row = LANDMARKS[280].astype(int)
    return np.asarray(cv2.circle(np.zeros((SIZE, SIZE), np.uint8), (int(column), int(row)), 6, 1, -1) > 0)


@pytest.mark.parametrize(
    ("part", "color"), [(half_fringe(), (0.03, 0.02, 0.02)), (mark(), (0.28, 0.08, 0.08))], ids=["fringe", "mark"]
)
def test_what_one_side_alone_has_stays_and_is_not_copied_to_the_other(
    part: NDArray[np.bool_], color: tuple[float, float, float]
) -> None:
    albedo = colored()
    albedo[part] = color
    np.testing.assert_allclose(factor_of(albedo)[MATTE > 0], 1, atol=0.2)
    lit = albedo * colored(1.5, 1 / 1.5) / SKIN
    evened = lit * factor_of(lit)
    rest = face() & ~part & ~part[:, ::-1]
    assert np.abs(np.log(evened[rest] / SKIN)).mean() < 0.35 * np.abs(np.log(lit[rest] / SKIN)).mean()


def test_clothes_of_two_colors_are_corrected_by_the_light_alone_and_less_than_the_face() -> None:
    albedo = colored()
    albedo[body() & (COLUMNS < 0)[None]] = [0.03, 0.03, 0.1]
    np.testing.assert_allclose(factor_of(albedo)[body()], 1, atol=0.02)
    lit = albedo * colored(1.4, 1 / 1.4) / SKIN
    left, right = (factor_of(lit)[body() & side[None]] for side in (COLUMNS < -0.2 * SIZE, COLUMNS > 0.2 * SIZE))
    assert 1 / 1.4 < left.min() <= left.max() < 1 < right.min() <= right.max() < 1.4


@pytest.mark.parametrize("roll_deg", [0, 30, 100, 180])
def test_a_face_that_leans_is_evened_out_across_its_own_axis(roll_deg: float) -> None:
    turn = cv2.getRotationMatrix2D((SIZE / 2, SIZE / 2), roll_deg, 1.0)
    landmarks = (LANDMARKS @ turn[:, :2].T + turn[:, 2]).astype(np.float32)
    albedo, skin = (
        np.asarray(cv2.warpAffine(each, turn, (SIZE, SIZE), borderMode=cv2.BORDER_REPLICATE))
        for each in (colored(1.5, 1 / 1.5), face().astype(np.uint8))
    )
    evened = albedo * even_sides(albedo, skin > 0, landmarks, SCHEME)
    inside = cv2.erode(skin, np.ones((5, 5))) > 0
    before, after = (np.abs(np.log(each[inside] / SKIN)).mean() for each in (albedo, evened))
    assert after < 0.3 * before


def test_a_mole_stays() -> None:
    albedo = colored()
    column, row = LANDMARKS[280].astype(int)  # a cheek
    cv2.circle(albedo, (int(column), int(row)), 1, (0.1, 0.05, 0.04), -1)
    factor = factor_of(albedo)
    assert 0.95 < factor[row, column].min() <= factor.max() < 1.05


def test_without_skin_on_both_sides_nothing_changes() -> None:
    skin = face() & (COLUMNS < -3)[None]
    np.testing.assert_array_equal(even_sides(colored(2, 0.5), skin, LANDMARKS, SCHEME), 1)
