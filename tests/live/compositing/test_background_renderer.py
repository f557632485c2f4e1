from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from relit_camera.base.config.look import (
    BlurBackground,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Lamp,
    Lighting,
    NoBackground,
)
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.light.environments.environment_panorama import (
    Environment,
    environment_from_panorama,
    panorama_from_radiance,
)
from relit_camera.live.compositing.background_renderer import (
    BackgroundRenderer,
    BackgroundRequest,
    apply_exposure,
    neutral_background,
)
from relit_camera.live.compositing.matted_frame import MattedFrame

SIZE = (160, 90)
AT_ONCE = Lighting(transition_s=0)
PICTURE = np.random.default_rng(7).integers(0, 256, (60, 80, 3), dtype=np.uint8)
STILLS = [
    NoBackground(),
    BlurBackground(),
    ColorBackground(color="#336699"),
    ImageBackground(image="office"),
    EnvironmentBackground(),
]


@pytest.fixture(scope="module")
def environment() -> Environment:
    """A red half at x < 0 and a blue one at x > 0."""
    radiance = np.full((32, 64, 3), 0.1, np.float32)
    radiance[:, :32, 0], radiance[:, 32:, 2] = 1, 1
    return environment_from_panorama("halves", panorama_from_radiance(radiance))


@pytest.fixture
def room() -> MattedFrame:
    """A secret pattern that nothing else here shows, with a person in the middle."""
    image = np.zeros((90, 160, 3), np.uint8)
    image.reshape(45, 2, 80, 2, 3)[::2, :, ::2] = (0, 255, 0)
    person = np.zeros((90, 160), np.uint8)
    person[30:, 60:100] = 255
    return MattedFrame(image, person)


def static(wanted: BackgroundRequest) -> np.ndarray:
    return BackgroundRenderer(SIZE).static_background(wanted, 0.0)


def halves(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    middle = picture.shape[1] // 2
    left, right = (linear_from_uint8(part).mean(axis=(0, 1)) for part in (picture[:, :middle], picture[:, middle:]))
    return left, right


@pytest.mark.parametrize("background", STILLS, ids=lambda background: background.kind)
def test_every_kind_gives_a_picture_of_the_size_that_is_made_once(
    background: NoBackground, environment: Environment
) -> None:
    renderer = BackgroundRenderer(SIZE)
    first = renderer.static_background(BackgroundRequest(background, Lighting(), environment, PICTURE), 0.0)
    again = renderer.static_background(
        BackgroundRequest(background.model_copy(), Lighting(), environment, PICTURE), 5.0
    )
    assert first.shape == (90, 160, 3)
    assert first.dtype == np.uint8
    assert again is first


def test_a_colour_is_that_colour() -> None:
    assert (static(BackgroundRequest(ColorBackground(color="#336699"), Lighting())) == (0x33, 0x66, 0x99)).all()


def test_none_is_a_dark_neutral_without_bands() -> None:
    picture = static(BackgroundRequest(NoBackground(), Lighting()))
    assert picture.max() < 64
    assert np.ptp(picture.astype(int), axis=2).max() < 12
    smooth = neutral_background((640, 360))[180, :, 1].astype(int)
    assert np.abs(np.diff(smooth)).max() == 1, "dither, and no step larger than a code"


@pytest.mark.parametrize("background", [BlurBackground(strength=0.3), EnvironmentBackground()], ids=lambda b: b.kind)
def test_the_environment_is_seen_turned_as_it_lights(background: BlurBackground, environment: Environment) -> None:
    left, right = halves(static(BackgroundRequest(background, Lighting(), environment)))
    assert left[0] > 2 * left[2]
    assert right[2] > 2 * right[0]
    turned_left, turned_right = halves(static(BackgroundRequest(background, Lighting(yaw_deg=180), environment)))
    assert turned_left[2] > 2 * turned_left[0]
    assert turned_right[0] > 2 * turned_right[2]


def test_exposure_and_gain_brighten_the_environment(environment: Environment) -> None:
    background = EnvironmentBackground()
    dark, darker = (
        linear_from_uint8(
            static(BackgroundRequest(background, Lighting(exposure_ev=ev, background_gain_ev=-3), environment))
        )
        for ev in (0, -1)
    )
    np.testing.assert_allclose(darker, dark / 2, atol=0.004)


def test_lamps_do_not_change_how_the_environment_is_seen(environment: Environment) -> None:
    background = EnvironmentBackground()
    plain, lit = (
        static(BackgroundRequest(background, Lighting(lamps=lamps), environment))
        for lamps in ((), (Lamp(intensity=50),))
    )
    np.testing.assert_array_equal(plain, lit)


@pytest.mark.parametrize("background", [BlurBackground(), EnvironmentBackground()], ids=lambda b: b.kind)
def test_without_an_environment_there_is_the_neutral(background: BlurBackground) -> None:
    np.testing.assert_array_equal(static(BackgroundRequest(background, Lighting())), neutral_background(SIZE))


def test_an_image_background_without_its_image_is_a_fault() -> None:
    with pytest.raises(ValueError, match="'office' was not given"):
        static(BackgroundRequest(ImageBackground(image="office"), Lighting()))


@pytest.mark.parametrize("size", [(40, 40), (80, 20), (200, 60), (13, 77)])
def test_an_image_is_cropped_evenly_to_fill(size: tuple[int, int]) -> None:
    """A ramp in both directions: middle stays middle, and one direction keeps its whole range."""
    y, x = np.mgrid[:60, :80]
    image = np.stack([x * 3, y * 4, np.zeros_like(x)], axis=-1).astype(np.uint8)
    filled = crop_to_fill(image, size)
    assert filled.shape == (size[1], size[0], 3)
    across, down = filled[..., 0].astype(float), filled[..., 1].astype(float)
    assert across.mean() == pytest.approx(118.5, abs=4)
    assert down.mean() == pytest.approx(118, abs=4)
    scale = max(size[0] / 80, size[1] / 60)
    assert np.ptp(across) == pytest.approx(3 * size[0] / scale, abs=3 + 6 / scale)
    assert np.ptp(down) == pytest.approx(4 * size[1] / scale, abs=4 + 8 / scale)


def test_gain_halves_or_raises_light_and_nothing_clips() -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    np.testing.assert_array_equal(apply_exposure(codes, 0), codes)
    np.testing.assert_allclose(linear_from_uint8(apply_exposure(codes, -1)), linear_from_uint8(codes) / 2, atol=0.004)
    raised = apply_exposure(codes, 1).ravel()[::3].astype(int)
    assert (np.diff(raised) >= 0).all()
    assert raised[100] > 130
    assert raised[-1] <= 255


def test_a_live_picture_stays_as_it_is_with_none(room: MattedFrame) -> None:
    live = BackgroundRenderer(SIZE).live_background(BackgroundRequest(NoBackground(), Lighting()), room, 0.0)
    np.testing.assert_array_equal(live, room.image)
    dimmed = BackgroundRenderer(SIZE).live_background(
        BackgroundRequest(NoBackground(), Lighting(background_gain_ev=-1)), room, 0.0
    )
    assert dimmed.max() == 188


def test_a_live_room_is_blurred_but_replaced_by_the_other_kinds(room: MattedFrame, environment: Environment) -> None:
    blurred = BackgroundRenderer(SIZE).live_background(
        BackgroundRequest(BlurBackground(), Lighting(), environment), room, 0.0
    )
    assert linear_from_uint8(blurred)[..., 1].mean() == pytest.approx(0.25, abs=0.01)
    assert blurred[..., 0].max() == 0
    for background in STILLS[2:]:
        wanted = BackgroundRequest(background, Lighting(), environment, PICTURE)
        np.testing.assert_array_equal(BackgroundRenderer(SIZE).live_background(wanted, room, 0.0), static(wanted))


def empty_room(code: int) -> MattedFrame:
    return MattedFrame(np.full((720, 1280, 3), code, np.uint8), np.zeros((720, 1280), np.uint8))


@pytest.mark.parametrize(
    ("strength", "shown_at", "held"),
    [(0.5, 1.04, True), (0.5, 1.06, False), (0.5, 0.9, False), (0.5, 1.0, False), (0.05, 1.04, False)],
)
def test_only_a_strongly_blurred_room_is_shown_again_and_only_for_a_moment(
    strength: float, shown_at: float, held: bool
) -> None:
    dark, bright = empty_room(20), empty_room(90)
    renderer = BackgroundRenderer((1280, 720))
    request = BackgroundRequest(BlurBackground(strength=strength), Lighting())
    renderer.live_background(request, dark, 1.0)[:] = 255  # it may be written to
    assert abs(int(renderer.live_background(request, bright, shown_at)[360, 640, 0]) - (20 if held else 90)) <= 1
    other = BackgroundRequest(BlurBackground(strength=0.4), Lighting())
    assert abs(int(renderer.live_background(other, bright, shown_at + 0.01)[360, 640, 0]) - 90) <= 1


def test_a_blurred_room_is_not_shown_again_after_another_background() -> None:
    dark, bright = empty_room(20), empty_room(90)
    renderer, blurred = BackgroundRenderer((1280, 720)), BackgroundRequest(BlurBackground(), Lighting())
    renderer.live_background(blurred, dark, 1.0)
    renderer.live_background(BackgroundRequest(ColorBackground(), Lighting()), dark, 1.01)
    assert abs(int(renderer.live_background(blurred, bright, 1.02)[360, 640, 0]) - 90) <= 1


@pytest.mark.parametrize("background", STILLS, ids=lambda background: background.kind)
def test_no_trace_of_the_live_room_outlives_the_live_picture(
    background: NoBackground, environment: Environment, room: MattedFrame
) -> None:
    """After a live picture, in the middle of any transition, a static background is that of a new renderer."""
    renderer = BackgroundRenderer(SIZE)
    for shown in (NoBackground(), BlurBackground()):
        renderer.live_background(BackgroundRequest(shown, Lighting(transition_s=10)), room, 1.0)
        wanted = BackgroundRequest(background, Lighting(transition_s=10), environment, PICTURE)
        np.testing.assert_array_equal(renderer.static_background(wanted, 1.01), static(wanted))


def test_a_change_is_faded_in_and_seen_at_once() -> None:
    renderer, lighting = BackgroundRenderer(SIZE), Lighting(transition_s=2)
    black, white = (BackgroundRequest(ColorBackground(color=color), lighting) for color in ("#000000", "#ffffff"))
    renderer.static_background(black, 4.5)
    shown = [int(renderer.static_background(white, now)[0, 0, 0]) for now in (5.0, 5.5, 6.5, 7.5)]
    assert shown == [round(255 * (1 - (1 - share) ** 3)) for share in (0.25, 0.5, 1, 1)]


def test_a_change_during_a_fade_goes_on_from_what_is_shown() -> None:
    renderer, lighting = BackgroundRenderer(SIZE), Lighting(transition_s=2)
    colours = [BackgroundRequest(ColorBackground(color=color), lighting) for color in ("#000000", "#ffffff", "#ff0000")]
    renderer.static_background(colours[0], 0.0)
    renderer.static_background(colours[1], 0.0)
    middle = renderer.static_background(colours[1], 1.0).copy()
    np.testing.assert_array_equal(renderer.static_background(colours[2], 1.0), middle)
    assert tuple(renderer.static_background(colours[2], 3.1)[0, 0]) == (255, 0, 0)


def test_a_background_that_is_turned_all_the_time_is_followed(environment: Environment) -> None:
    renderer, now = BackgroundRenderer(SIZE), 0.0
    for now in np.arange(0, 4, 0.04):
        turning = Lighting(yaw_deg=45 * now)
        shown = renderer.static_background(BackgroundRequest(EnvironmentBackground(), turning, environment), now)
    errors = []
    for behind_s in (0.0, 0.15, 4.0):
        then = BackgroundRequest(EnvironmentBackground(), Lighting(yaw_deg=45 * max(now - behind_s, 0)), environment)
        errors.append(np.abs(shown.astype(int) - static(then)).mean())
    assert min(errors[:2]) < 0.25 * errors[2]


def test_a_clock_set_back_ends_the_fade() -> None:
    renderer, lighting = BackgroundRenderer(SIZE), Lighting(transition_s=2)
    black, white = (BackgroundRequest(ColorBackground(color=color), lighting) for color in ("#000000", "#ffffff"))
    renderer.static_background(black, 5.0)
    renderer.static_background(white, 5.1)
    assert (renderer.static_background(white, 0.0) == 255).all()


def test_lighting_that_a_background_does_not_show_does_not_make_it_anew() -> None:
    renderer = BackgroundRenderer(SIZE)
    first = renderer.static_background(
        BackgroundRequest(ImageBackground(image="office"), Lighting(), None, PICTURE), 0.0
    )
    other = BackgroundRequest(ImageBackground(image="office"), Lighting(yaw_deg=40, exposure_ev=1), None, PICTURE)
    assert renderer.static_background(other, 1.0) is first


def test_another_picture_of_the_same_name_is_shown() -> None:
    renderer = BackgroundRenderer(SIZE)
    renderer.static_background(BackgroundRequest(ImageBackground(image="office"), AT_ONCE, None, PICTURE), 0.0)
    other = BackgroundRequest(ImageBackground(image="office"), AT_ONCE, None, np.full_like(PICTURE, 9))
    assert (renderer.static_background(other, 1.0) == 9).all()


@pytest.mark.parametrize("live", [False, True], ids=["another background", "the live room"])
def test_a_place_that_is_shown_no_more_is_not_kept(room: MattedFrame, live: bool) -> None:
    renderer = BackgroundRenderer(SIZE)
    place = environment_from_panorama("grey", panorama_from_radiance(np.ones((32, 64, 3), np.float32)))
    renderer.static_background(BackgroundRequest(EnvironmentBackground(), AT_ONCE, place), 0.0)
    held = weakref.ref(place.panorama)
    del place
    if live:
        renderer.live_background(BackgroundRequest(NoBackground(), AT_ONCE), room, 0.1)
    else:
        renderer.static_background(BackgroundRequest(ColorBackground(color="#336699"), AT_ONCE), 0.1)
    gc.collect()
    assert held() is None
