"""Person over background, as the display shows it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from relit_camera.base.config.look import ColorBackground, Lighting, Look, NoBackground
from relit_camera.base.images.image_types import Frame, Mask
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.live.compositing.compositor import Compositor
from relit_camera.live.compositing.matting import Matting
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer

SIZE = (64, 48)
GREEN = ColorBackground(color="#00ff00")


class LeftHalf:
    """A matte that takes the left half of the picture for the person."""

    made = 0

    def __init__(self) -> None:
        type(self).made += 1

    def matte(self, frame: Frame) -> Mask:
        alpha = np.zeros((frame.size[1], frame.size[0]), np.float32)
        alpha[:, : frame.size[0] // 2] = 1
        return alpha


def compositor(timer: StageTimer | None = None, open_matte: Callable[[], Matting] = LeftHalf) -> Compositor:
    return Compositor(SIZE, open_matte, timer or StageTimer())


def scene(background: object = GREEN, **lighting: object) -> Scene:
    return Scene(Look.model_validate({"background": background, "lighting": {"environment": None, **lighting}}))


def square(alpha: float, at: tuple[int, int] = (20, 10), light: float = 0.4) -> WarpedLayer:
    """A grey square of 16 x 16 pixels, premultiplied."""
    mask = np.full((16, 16), alpha, np.float32)
    return WarpedLayer(np.full((16, 16, 3), light * alpha, np.float32), mask, at)


def live_frame(time_s: float = 0.0) -> Frame:
    return Frame(np.full((SIZE[1], SIZE[0], 3), 128, np.uint8), 0, 0.0, time_s)


def test_an_opaque_person_hides_the_background_at_its_place() -> None:
    picture = compositor().composite_source(square(1.0), scene(), 0.0)
    expected = display_from_linear(np.full((1, 1, 3), 0.4, np.float32))[0, 0]
    assert (picture[10:26, 20:36] == expected).all()
    picture[10:26, 20:36] = [0, 255, 0]
    assert (picture == [0, 255, 0]).all()


def test_half_alpha_mixes_in_linear_light() -> None:
    picture = compositor().composite_source(square(0.5), scene(), 0.0)
    expected = display_from_linear(np.array([[[0.2, 0.7, 0.2]]], np.float32))[0, 0].astype(int)
    assert np.abs(picture[18, 28].astype(int) - expected).max() <= 1


@pytest.mark.parametrize("at", [(-8, -8), (56, 40), (200, 200), (-40, 3)])
def test_a_person_may_leave_the_picture(at: tuple[int, int]) -> None:
    picture = compositor().composite_source(square(1.0, at), scene(), 0.0)
    columns, rows = (min(at[i] + 16, SIZE[i]) - max(at[i], 0) for i in range(2))
    assert (picture != [0, 255, 0]).any(axis=2).sum() == max(columns, 0) * max(rows, 0)


def test_a_new_background_is_faded_in() -> None:
    made = compositor()
    made.composite_source(square(0.0), scene(transition_s=1.0), 0.0)
    blue = ColorBackground(color="#0000ff")
    half = made.composite_source(square(0.0), scene(blue, transition_s=1.0), 1 - 0.5 ** (1 / 3))
    assert (np.abs(half.astype(int) - [0, 128, 128]) <= 2).all()
    assert (made.composite_source(square(0.0), scene(blue, transition_s=1.0), 1.1) == [0, 0, 255]).all()


def test_the_live_room_passes_without_a_matte() -> None:
    light = np.full((SIZE[1], SIZE[0], 3), 0.3, np.float32)
    timer = StageTimer()
    picture = compositor(timer, pytest.fail).composite_live(light, live_frame(), scene(NoBackground()))
    np.testing.assert_array_equal(picture, display_from_linear(light))
    assert "matte" not in timer.lap_ms()


def test_a_live_person_stands_before_the_chosen_background() -> None:
    LeftHalf.made = 0
    light, timer = np.full((SIZE[1], SIZE[0], 3), 0.3, np.float32), StageTimer()
    made = compositor(timer)
    for time_s in (0.0, 0.1):
        picture = made.composite_live(light, live_frame(time_s), scene())
    assert LeftHalf.made == 1
    assert timer.lap_ms()["matte"] > 0
    np.testing.assert_array_equal(picture[:, :32], display_from_linear(light)[:, :32])
    assert (picture[:, 32:] == [0, 255, 0]).all()


def test_background_gain_dims_the_room_and_not_the_person() -> None:
    light = np.full((SIZE[1], SIZE[0], 3), 0.3, np.float32)
    dimmed = scene(NoBackground(), **Lighting(background_gain_ev=-1).model_dump(include={"background_gain_ev"}))
    picture = compositor().composite_live(light, live_frame(), dimmed)
    expected = display_from_linear(np.full((1, 1, 3), 0.15, np.float32))[0, 0].astype(int)
    assert np.abs(picture[:, 40:].astype(int) - expected).max() <= 1
    np.testing.assert_array_equal(picture[:, :24], display_from_linear(light)[:, :24])
