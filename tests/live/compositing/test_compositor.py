"""Person over background, as the display shows it."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from relit_camera.base.config.look import BlurBackground, ColorBackground, Lighting, Look, NoBackground
from relit_camera.base.errors import ModelError
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_types import Alpha, DisplayImage, Frame
from relit_camera.face.matting import Matting
from relit_camera.live.compositing.compositor import Compositor
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.status.stage_timing import StageTimer

SIZE = (64, 48)
GREEN = ColorBackground(color="#00ff00")
GREY = 140


class LeftHalf:
    """A matte that takes the left half of the picture for the person."""

    made = 0

    def __init__(self) -> None:
        type(self).made += 1

    def matte(self, frame: Frame) -> Alpha:
        alpha = np.zeros((frame.size[1], frame.size[0]), np.uint8)
        alpha[:, : frame.size[0] // 2] = 255
        return alpha


def compositor(timer: StageTimer | None = None, open_matte: Callable[[], Matting] = LeftHalf) -> Compositor:
    return Compositor(SIZE, open_matte, timer or StageTimer(), {})


def scene(background: object = GREEN, **lighting: object) -> Scene:
    return Scene(Look.model_validate({"background": background, "lighting": {"environment": None, **lighting}}))


def square(alpha: int, at: tuple[int, int] = (20, 10)) -> WarpedLayer:
    """A grey square of 16 x 16 pixels, straight."""
    image = np.full((16, 16, 4), GREY, np.uint8)
    image[..., 3] = alpha
    return WarpedLayer(image, at)


def relit_picture() -> DisplayImage:
    return np.full((SIZE[1], SIZE[0], 3), 150, np.uint8)


def live_frame(time_s: float = 0.0) -> Frame:
    return Frame(np.full((SIZE[1], SIZE[0], 3), 128, np.uint8), 0, 0.0, time_s)


def test_an_opaque_person_hides_the_background_at_its_place() -> None:
    picture = compositor().composite_source(square(255), scene(), 0.0)
    assert (picture[10:26, 20:36] == GREY).all()
    picture[10:26, 20:36] = [0, 255, 0]
    assert (picture == [0, 255, 0]).all()


def test_half_alpha_mixes_in_linear_light() -> None:
    picture = compositor().composite_source(square(51), scene(), 0.0)
    light = linear_from_uint8(np.array([[[GREY, GREY, GREY]]], np.uint8))[0, 0] / 5 + [0, 0.8, 0]
    assert np.abs(picture[18, 28].astype(int) - uint8_from_linear(light.astype(np.float32))).max() <= 1


@pytest.mark.parametrize("at", [(-8, -8), (56, 40), (200, 200), (-40, 3)])
def test_a_person_may_leave_the_picture(at: tuple[int, int]) -> None:
    picture = compositor().composite_source(square(255, at), scene(), 0.0)
    columns, rows = (min(at[i] + 16, SIZE[i]) - max(at[i], 0) for i in range(2))
    assert (picture != [0, 255, 0]).any(axis=2).sum() == max(columns, 0) * max(rows, 0)


def test_a_new_background_is_faded_in() -> None:
    made = compositor()
    made.composite_source(square(0), scene(transition_s=1.0), 0.0)
    blue = ColorBackground(color="#0000ff")
    half = made.composite_source(square(0), scene(blue, transition_s=1.0), 1 - 0.5 ** (1 / 3))
    assert (np.abs(half.astype(int) - [0, 128, 128]) <= 2).all()
    assert (made.composite_source(square(0), scene(blue, transition_s=1.0), 1.1) == [0, 0, 255]).all()


def composed(
    made: Compositor,
    picture: DisplayImage,
    frame: Frame,
    shown: Scene,
    person: np.ndarray | None = None,
    matte_every: int = 1,
) -> DisplayImage:
    """A live picture whose people are parted from the room."""
    return made.composite_live(picture, made.person_alpha(frame, shown, person, matte_every), frame, shown)


def test_a_kept_room_is_that_of_the_frame_and_the_person_that_of_the_picture() -> None:
    relit, live = relit_picture(), live_frame()
    picture = composed(compositor(), relit, live, scene(NoBackground()))
    np.testing.assert_array_equal(picture[:, :32], relit[:, :32])
    np.testing.assert_array_equal(picture[:, 32:], live.image[:, 32:])


def test_a_blurred_room_is_that_of_the_frame() -> None:
    relit, live = np.full_like(relit_picture(), 250), live_frame()
    picture = composed(compositor(), relit, live, scene(BlurBackground()))
    assert np.abs(picture[:, 48:].astype(int) - live.image[:, 48:]).max() <= 1


def test_what_surely_is_the_person_is_left_out_by_no_matte() -> None:
    """Cells of eight pixels; the matte has the left half alone."""
    relit, live, sure = relit_picture(), live_frame(), np.zeros((6, 8), np.float32)
    sure[2:4, 5:8] = 1
    picture = composed(compositor(), relit, live, scene(NoBackground()), sure)
    assert (picture[20:28, 48:60] == relit[0, 0]).all()
    assert (picture[:8, 40:] == live.image[0, 0]).all()


@pytest.mark.parametrize(("background", "looks"), [(NoBackground(), 3), (GREEN, 6)])
def test_before_a_kept_room_the_matte_may_be_that_of_the_last_frame(background: object, looks: int) -> None:
    class Counting(LeftHalf):
        asked = 0

        def matte(self, frame: Frame) -> Alpha:
            type(self).asked += 1
            return super().matte(frame)

    made = compositor(open_matte=Counting)
    for index in range(6):
        picture = composed(made, relit_picture(), live_frame(index / 30), scene(background), None, 2)
    assert Counting.asked == looks
    np.testing.assert_array_equal(picture[:, :32], relit_picture()[:, :32])


@pytest.mark.parametrize("background", [NoBackground(), BlurBackground(), GREEN])
def test_no_more_of_a_picture_is_looked_at_than_is_needed(background: object) -> None:
    random, live, shown = np.random.default_rng(0), live_frame(), scene(background)
    relit = random.integers(0, 255, live.image.shape).astype(np.uint8)
    made = compositor()
    alpha = cv2.GaussianBlur(made.person_alpha(live, shown), (0, 0), 2)
    left, top, right, bottom = made.needed(alpha, shown)
    part = random.integers(0, 255, live.image.shape).astype(np.uint8)
    part[top:bottom, left:right] = relit[top:bottom, left:right]
    whole = compositor().composite_live(relit, alpha, live, shown)
    assert np.abs(made.composite_live(part, alpha, live, shown).astype(int) - whole).max() <= 1


def test_a_matte_that_is_blind_leaves_nobody_unlit() -> None:
    class Blind(LeftHalf):
        def matte(self, frame: Frame) -> Alpha:
            return np.zeros_like(super().matte(frame))

    relit, sure = relit_picture(), np.zeros((6, 8), np.float32)
    made = compositor(open_matte=Blind)
    assert composed(made, relit, live_frame(), scene(NoBackground()), sure) is relit
    empty = composed(made, relit, live_frame(), scene(NoBackground()))  # nobody is followed: the room is as filmed
    np.testing.assert_array_equal(empty, live_frame().image)


def test_a_room_that_cannot_be_parted_is_relit_with_the_person_and_that_is_told() -> None:
    def missing() -> Matting:
        raise ModelError("model selfie_landscape is missing", "relit models pull")

    troubles: dict[str, Degradation] = {}
    relit, made = relit_picture(), Compositor(SIZE, missing, StageTimer(), troubles)
    assert composed(made, relit, live_frame(), scene(NoBackground())) is relit
    assert [each.code for each in troubles.values()] == [DegradationCode.ROOM_NOT_PARTED]
    with pytest.raises(ModelError):
        composed(made, relit, live_frame(), scene(GREEN))


def test_a_live_person_stands_before_the_chosen_background() -> None:
    LeftHalf.made = 0
    relit, timer = relit_picture(), StageTimer()
    made = compositor(timer)
    for time_s in (0.0, 0.1):
        picture = composed(made, relit, live_frame(time_s), scene())
    assert LeftHalf.made == 1
    assert timer.lap_ms()["matte"] > 0
    np.testing.assert_array_equal(picture[:, :32], relit[:, :32])
    assert (picture[:, 32:] == [0, 255, 0]).all()


def test_background_gain_dims_the_room_and_not_the_person() -> None:
    relit = relit_picture()
    dimmed = scene(NoBackground(), **Lighting(background_gain_ev=-1).model_dump(include={"background_gain_ev"}))
    picture = composed(compositor(), relit, live_frame(), dimmed)
    expected = uint8_from_linear(linear_from_uint8(live_frame().image) / np.float32(2)).astype(int)
    assert np.abs(picture[:, 40:] - expected[:, 40:]).max() <= 1
    np.testing.assert_array_equal(picture[:, :24], relit[:, :24])


def test_no_picture_shares_memory_with_the_background_or_the_next_one() -> None:
    """Who keeps a picture keeps it as it was: the publisher and its viewers hold some for a while."""
    made = compositor()
    pictures = [made.composite_source(square(0, at), scene(), 0.1 * i) for i, at in enumerate([(20, 10), (200, 200)])]
    pictures[0][:] = 7
    assert (pictures[1] == [0, 255, 0]).all()
    assert (made.composite_source(square(0), scene(), 0.3) == [0, 255, 0]).all()
