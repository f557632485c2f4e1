"""The inside of the mouth: drawn where the lips part, lit as the lips are, and nowhere else."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.face.head_pose import project
from relit_camera.live.reenactment.motion_transfer import FACE_CENTER, rotate_about
from relit_camera.live.reenactment.mouth.mouth_interior import MouthInterior, _Opening
from relit_camera.live.reenactment.source_image import SourceFace
from tests.live.people import SCHEME, face_of, person

SCALE = 4.0
TO_OUTPUT = np.array([[SCALE, 0, 0], [0, SCALE, 0]])
SKIN = np.array([0.4, 0.25, 0.2], np.float32)


@pytest.fixture(scope="module")
def face() -> SourceFace:
    return face_of(person())


@pytest.fixture(scope="module")
def mouth(face: SourceFace) -> MouthInterior:
    return MouthInterior(face, person().neutral)


def opened(face: SourceFace, pixels: float) -> NDArray[np.float64]:
    """Landmarks with the lower lip down by some still pixels."""
    landmarks = face.landmarks.astype(np.float64)
    landmarks[list(SCHEME.lower_lip_inner[1:-1]), 1] += pixels
    return landmarks


def draw(
    mouth: MouthInterior, face: SourceFace, landmarks: np.ndarray, light: float = 1.0, alpha: int = 255
) -> tuple[LinearImage, LinearImage]:
    """A picture of plain skin with the mouth drawn, linear; and the skin."""
    shape = int(face.size[1] * SCALE), int(face.size[0] * SCALE)
    relit = np.broadcast_to(SKIN * np.float32(light), (face.size[1], face.size[0], 3))
    skin = np.broadcast_to(display_from_linear(relit[:1, :1]), (*shape, 3))
    image = np.dstack([skin, np.full(shape, alpha, np.uint8)])
    mouth.draw(image, relit, landmarks, face.pose, TO_OUTPUT)
    np.testing.assert_array_equal(image[..., 3], alpha)
    return linear_from_display(np.ascontiguousarray(image[..., :3])), linear_from_display(np.ascontiguousarray(skin))


def changed(picture: np.ndarray, skin: np.ndarray) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    rows, columns = np.nonzero(np.abs(picture - skin).max(axis=2) > 0.01)
    return (columns + 0.5) / SCALE, (rows + 0.5) / SCALE


def test_a_shut_mouth_is_left_alone(mouth: MouthInterior, face: SourceFace) -> None:
    for pixels in (0.0, -1.0):
        picture, skin = draw(mouth, face, opened(face, pixels))
        np.testing.assert_array_equal(picture, skin)


def test_it_is_drawn_between_the_lips_and_nowhere_else(mouth: MouthInterior, face: SourceFace) -> None:
    landmarks = opened(face, 8)
    x, y = changed(*draw(mouth, face, landmarks))
    lips = landmarks[[*SCHEME.upper_lip_inner, *SCHEME.lower_lip_inner]]
    assert len(x) > 100
    assert x.min() > lips[:, 0].min() - 1
    assert x.max() < lips[:, 0].max() + 1
    assert y.min() > lips[:, 1].min() - 1
    assert y.max() < lips[:, 1].max() + 1.5


def test_the_middle_is_dark_and_red(mouth: MouthInterior, face: SourceFace) -> None:
    landmarks = opened(face, 8)
    picture, skin = draw(mouth, face, landmarks)
    x, y = landmarks[[SCHEME.lip_gap[1][0]]].mean(axis=0) - [0, 4]
    inside = picture[int(y * SCALE), int(x * SCALE)]
    assert inside.max() < 0.35 * skin.max()
    assert inside[0] > inside[1] > 0
    assert inside[0] > inside[2] > 0


def test_teeth_are_brighter_than_the_cavity_and_lie_at_the_upper_lip(mouth: MouthInterior, face: SourceFace) -> None:
    landmarks = opened(face, 10)
    picture, _ = draw(mouth, face, landmarks)
    x = landmarks[list(SCHEME.lips), 0].mean()
    top = landmarks[list(SCHEME.lip_gap[0]), 1].mean()
    column = picture[:, int(x * SCALE)].mean(axis=1)
    just_below = column[int((top + 0.3) * SCALE) : int((top + 1.5) * SCALE)].max()
    deep = column[int((top + 5) * SCALE) : int((top + 7) * SCALE)].max()
    assert just_below > 2 * deep


def test_it_is_lit_as_the_lips_are(mouth: MouthInterior, face: SourceFace) -> None:
    landmarks = opened(face, 8)
    once, twice = (draw(mouth, face, landmarks, light)[0] for light in (0.75, 1.5))
    np.testing.assert_allclose(twice, 2 * once, atol=0.012)  # two codes


def test_it_fades_in_and_never_jumps(mouth: MouthInterior, face: SourceFace) -> None:
    """From shut to open in small steps, no pixel changes by more than a share of the way."""
    pictures = [draw(mouth, face, opened(face, pixels))[0] for pixels in np.arange(0, 3, 0.1)]
    steps = [np.abs(b - a).max() for a, b in pairwise(pictures)]
    assert max(steps) < 0.15
    assert np.abs(pictures[-1] - pictures[0]).max() > 0.2


def test_the_picture_stays_straight(mouth: MouthInterior, face: SourceFace) -> None:
    whole, half = (draw(mouth, face, opened(face, 8), alpha=alpha)[0] for alpha in (255, 128))
    np.testing.assert_array_equal(half, whole)


def test_a_mouth_beyond_the_picture_is_no_trouble(mouth: MouthInterior, face: SourceFace) -> None:
    for corner in ((-5000, 0), (0, 5000), (120, 0)):
        image = np.full((40, 40, 4), 200, np.uint8)
        moved = np.column_stack([TO_OUTPUT[:, :2], corner]).astype(float)
        relit = np.ones((face.size[1], face.size[0], 3), np.float32)
        mouth.draw(image, relit, opened(face, 8), face.pose, moved)
        np.testing.assert_array_equal(image, 200)


def inside_rows(mouth: MouthInterior, face: SourceFace, landmarks: np.ndarray) -> NDArray[np.float32]:
    """Blue of the rows between the lips beside the middle of the mouth, from the upper lip down."""
    picture, _ = draw(mouth, face, landmarks)
    x = landmarks[list(SCHEME.lips), 0].mean() + 0.7
    top, bottom = (landmarks[list(edge), 1].mean() for edge in SCHEME.lip_gap)
    return picture[int((top + 0.5) * SCALE) : int((bottom - 0.5) * SCALE), int(x * SCALE), 2]


def test_an_opened_jaw_parts_the_teeth_and_a_smile_does_not(mouth: MouthInterior, face: SourceFace) -> None:
    jaw = opened(face, 9)
    smile = opened(face, 4.5)
    smile[list(SCHEME.upper_lip_inner[1:-1]), 1] -= 4.5
    parted, together = inside_rows(mouth, face, jaw), inside_rows(mouth, face, smile)
    teeth = 0.1
    assert parted[:4].max() > teeth
    assert (parted[len(parted) // 4 : len(parted) // 2] < teeth / 2).any()
    assert np.median(together) > teeth
    assert (together > teeth).mean() > (parted > teeth).mean() + 0.3


def test_lower_teeth_show_at_the_lower_lip(mouth: MouthInterior, face: SourceFace) -> None:
    rows = inside_rows(mouth, face, opened(face, 12))
    third = len(rows) // 3
    assert rows[-third:].max() > 2 * rows[third:-third].min()


def turned_mouth(mouth: MouthInterior, face: SourceFace, turn: Rotation) -> NDArray[np.float32]:
    """A wide open mouth of a head turned about its middle, and nothing else, over black."""
    pose = rotate_about(FACE_CENTER, face.pose, turn)
    open_by = np.zeros((SCHEME.count, 3))
    open_by[list(SCHEME.lower_lip_inner[1:-1]), 1] = -1.5
    landmarks = project(face.head_points + open_by, pose, face.size).astype(np.float64)
    image = np.zeros((int(face.size[1] * SCALE), int(face.size[0] * SCALE), 4), np.uint8)
    mouth.draw(image, np.ones((face.size[1], face.size[0], 3), np.float32), landmarks, pose, TO_OUTPUT)
    return linear_from_display(np.ascontiguousarray(image[..., :3]))


def test_a_mouth_turned_to_one_side_is_the_mirror_image_of_one_turned_to_the_other(
    mouth: MouthInterior, face: SourceFace
) -> None:
    left, right = (turned_mouth(mouth, face, rotation_from_angles(yaw)) for yaw in (-30, 30))
    assert left.max() > 0.2
    ahead = turned_mouth(mouth, face, rotation_from_angles(0))
    mirrored = np.abs(left - right[:, ::-1]).mean()
    assert mirrored < 0.35 * np.abs(left - ahead).mean()
    assert mirrored < 0.35 * np.abs(left - right).mean()


def test_a_head_that_leans_has_the_same_mouth(mouth: MouthInterior, face: SourceFace) -> None:
    upright, upside_down = (turned_mouth(mouth, face, rotation_from_angles(0, 0, roll)) for roll in (0, 180))
    assert upside_down.sum() == pytest.approx(upright.sum(), rel=0.1)


@pytest.mark.parametrize("angles", [(60, 0, 0), (85, 0, 0), (120, 0, 0), (0, 40, 0), (0, -80, 0), (30, 20, 90)])
@pytest.mark.filterwarnings("error")
def test_no_turn_breaks_it(mouth: MouthInterior, face: SourceFace, angles: tuple[float, float, float]) -> None:
    assert np.isfinite(turned_mouth(mouth, face, rotation_from_angles(*angles))).all()


def test_light_through_the_lips_falls_with_depth_and_toward_their_edges() -> None:
    x = np.linspace(-2, 2, 9, dtype=np.float32)
    edge = np.stack([x, np.full_like(x, 0.5), np.zeros_like(x)])
    opening = _Opening(edge, edge * np.array([[1], [-1], [1]], np.float32))
    depths = np.array([0.0, 0.5, 1.0, 3.0], np.float32)
    middle = opening.light(np.stack([0 * depths, 0 * depths, -depths]))
    assert (np.diff(middle) < 0).all()
    assert middle[1] == pytest.approx(1 / np.sqrt(2), abs=1e-3)  # a strip under 45° up and down: its form factor
    high = opening.light(np.array([[0, 0], [0.0, 0.5], [-0.5, -0.5]], np.float32))
    assert high[1] < 0.7 * high[0]
    assert opening.light(np.array([[0], [2.0], [-0.01]], np.float32)) == pytest.approx(0, abs=0.05)
