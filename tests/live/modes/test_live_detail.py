"""How far a relit live picture leans on the live picture, and how far on the relit source image."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.light_multiplication import light_of_root, root_of_light
from relit_camera.live.modes.live_detail import (
    CellBlend,
    SourceCells,
    blend_cells,
    live_cells,
    noise_fraction,
    smoothed,
)

ROWS, COLUMNS, UNIT = 60, 80, 20.0
ALBEDO = 0.3 + 0.2 * np.random.default_rng(1).random((ROWS, COLUMNS, 3))
"""Detail that the live picture has, and the source image has not."""
SIDE = np.linspace(0.4, 1.6, COLUMNS)[None, :, None]
"""Light from one side, which the scene wants."""
EVERYWHERE = np.ones((ROWS, COLUMNS), np.float32)


def blended(live: np.ndarray, room: np.ndarray, scene: np.ndarray = SIDE, brightest: float = 150.0) -> CellBlend:
    """The blend of a picture, with a source image of even albedo under the estimated room and the scene."""
    even = np.full((ROWS, COLUMNS, 3), ALBEDO.mean())
    relit, under_room = (root_of_light((even * light).astype(np.float32)) for light in (scene, room))
    source = SourceCells(relit, under_room, EVERYWHERE, EVERYWHERE, EVERYWHERE, EVERYWHERE)
    roots = root_of_light(live.astype(np.float32))
    return blend_cells(roots, roots, brightest * EVERYWHERE, source, UNIT)


def ratio_of(blend: CellBlend) -> np.ndarray:
    return light_of_root(blend.ratio[..., :3] / blend.ratio[..., 3:])


def error(live: np.ndarray, blend: CellBlend) -> float:
    """RMS error of the live picture times the ratio, as a fraction of the truth's mean, away from the border."""
    off = (live * ratio_of(blend) - ALBEDO * SIDE)[10:-10, 10:-10]
    return float(np.sqrt((off**2).mean()) / ALBEDO.mean())


def test_where_the_room_is_known_the_light_alone_is_exchanged() -> None:
    room = np.linspace(1.2, 0.8, ROWS)[:, None, None] * np.ones((1, COLUMNS, 1))
    live = ALBEDO * room
    blend = blended(live, room)
    assert error(live, blend) < 0.02
    assert blend.trust.min() > 0.9


def test_a_shadow_that_the_estimate_lacks_is_taken_from_the_coarse_light() -> None:
    """Truth: the same surface without it. Multiplied by the ratio alone, the shadow would stay."""
    shadow = np.where(np.arange(COLUMNS) < COLUMNS / 2, 0.35, 1.0)[None, :, None] * np.ones((ROWS, 1, 1))
    live = ALBEDO * shadow
    blend = blended(live, np.ones((ROWS, COLUMNS, 1)))
    multiplied = float(np.sqrt((((ALBEDO * shadow - ALBEDO) * SIDE)[10:-10, 10:-10] ** 2).mean()) / ALBEDO.mean())
    assert error(live, blend) < 0.5 * multiplied


@pytest.mark.parametrize("gain", [0.5, 2.0])
def test_the_webcams_exposure_is_corrected_at_once(gain: float) -> None:
    live = gain * ALBEDO
    assert error(live, blended(live, np.ones((ROWS, COLUMNS, 1)))) < 0.1


def test_overexposed_cells_have_no_detail() -> None:
    assert blended(ALBEDO, np.ones((ROWS, COLUMNS, 1)), brightest=255).trust.max() == 0
    assert blended(ALBEDO, np.ones((ROWS, COLUMNS, 1)), brightest=200).trust.min() > 0.9


def test_noise_is_not_multiplied_without_limit() -> None:
    bright = np.full((ROWS, COLUMNS, 1), 30.0)
    trust = blended(0.02 * ALBEDO, np.full((ROWS, COLUMNS, 1), 0.02), bright).trust
    assert trust.max() < 0.2


def test_something_else_before_the_face_is_not_painted_as_skin() -> None:
    live = ALBEDO.copy()
    live[20:40, 30:50] = 0.01  # a dark mug
    ratio = ratio_of(blended(live, np.ones((ROWS, COLUMNS, 1))))
    assert ratio[25:35, 35:45].max() < 3  # not the 40 that would make skin of it


def test_cells_are_the_live_pictures() -> None:
    image = np.arange(0, 240, 1, dtype=np.uint8)[None, :, None].repeat(60, 0).repeat(3, 2)
    light, brightest = live_cells(image, 6, (0, 0, 40, 10))
    assert light.shape == (10, 40, 3)
    np.testing.assert_allclose(brightest[0], np.arange(40) * 6 + 2.5, atol=0.6)
    light, brightest = live_cells(image[:-1, :-1], 6, (0, 0, 40, 10))
    assert light.shape == (10, 40, 3)


@pytest.mark.parametrize("brightest", [100.0, 255.0])
@pytest.mark.parametrize("confidence", [0.0, 1.0])
def test_black_pixels_and_nothing_to_go_by_are_numbers_all_the_same(brightest: float, confidence: float) -> None:
    live = np.full((ROWS, COLUMNS, 3), 1.0, np.float32)
    live[:8, :8] = 0
    relit = root_of_light(np.full((ROWS, COLUMNS, 3), 0.3, np.float32))
    room = relit.copy()
    room[20:24, 20:24] = 0
    sure = np.float32(confidence) * EVERYWHERE
    blend = blend_cells(
        live, live, brightest * EVERYWHERE, SourceCells(relit, room, sure, EVERYWHERE, EVERYWHERE, EVERYWHERE), UNIT
    )
    assert np.isfinite(blend.ratio).all()
    assert np.isfinite(blend.trust).all()
    assert blend.ratio[..., :3].max() < 6
    assert (blend.ratio[..., 3] <= confidence).all()


def test_eyes_and_lips_are_the_live_pictures_even_where_they_are_overexposed() -> None:
    skin = EVERYWHERE.copy()
    skin[20:40, 30:50] = 0
    relit = root_of_light(np.full((ROWS, COLUMNS, 3), 0.3, np.float32))
    blend = blend_cells(
        relit, relit, 255 * EVERYWHERE, SourceCells(relit, relit, EVERYWHERE, skin, EVERYWHERE, EVERYWHERE), UNIT
    )
    assert blend.trust[25:35, 35:45].min() == 1
    assert blend.trust[5, 5] < 0.1


def test_noise_near_overexposure_does_not_flicker() -> None:
    rng, shown = np.random.default_rng(3), []
    relit = root_of_light(np.full((ROWS, COLUMNS, 3), 0.3, np.float32))
    source = SourceCells(relit, relit, EVERYWHERE, EVERYWHERE, EVERYWHERE, EVERYWHERE)
    for _ in range(6):
        brightest = (241 + rng.normal(0, 1.5, (ROWS, COLUMNS))).astype(np.float32)
        shown.append(blend_cells(relit, relit, brightest, source, UNIT).trust[5:-5, 5:-5])
    assert np.diff(shown, axis=0).std() < 0.05


STEP = 6
BOX = (0, 0, COLUMNS, ROWS)


def noisy(image: np.ndarray, sigma: float) -> np.ndarray:
    return np.clip(image + np.random.default_rng(5).normal(0, sigma, image.shape), 0, 255).astype(np.uint8)


def dim_picture() -> np.ndarray:
    """A dim live picture: even above, with a coarse weave below."""
    image = np.full((ROWS * STEP, COLUMNS * STEP, 3), 60.0)
    weave = np.random.default_rng(7).choice([-20.0, 20.0], (ROWS * STEP // 2, COLUMNS * STEP, 1))
    image[ROWS * STEP // 2 :] += weave
    return image


def noise_in(
    image: np.ndarray,
    factor: float,
    confidence: np.ndarray = EVERYWHERE,
    step: int = STEP,
    near: np.ndarray | None = None,
) -> np.ndarray:
    """How much of each cell is taken for noise where roots of the picture are multiplied by `factor`."""
    roots = np.full((ROWS, COLUMNS, 3), 0.5, np.float32)
    source = SourceCells(roots, roots, confidence, EVERYWHERE, EVERYWHERE, confidence if near is None else near)
    return noise_fraction(image, step, BOX, np.full((ROWS, COLUMNS, 3), factor, np.float32), source, UNIT)


def test_noise_that_would_be_seen_is_told_from_detail() -> None:
    fraction = noise_in(noisy(dim_picture(), 4.0), 2.5)
    assert fraction[3:27, 3:-3].mean() > 0.85
    assert fraction[33:-3, 3:-3].mean() < 0.2


@pytest.mark.parametrize("factor", [0.5, 1.0])
def test_noise_that_the_ratio_does_not_multiply_stays(factor: float) -> None:
    assert noise_in(noisy(dim_picture(), 4.0), factor).max() == 0


def test_in_the_dark_more_is_taken_for_noise() -> None:
    """A sensor's own noise, the same in light everywhere, is most of it there; the calm half alone does not tell it."""
    light = np.full((ROWS * STEP, COLUMNS * STEP, 3), 0.6)
    light[ROWS * STEP // 2 :] = 0.012
    sensor = light + np.random.default_rng(8).normal(0, 1, light.shape) * np.sqrt(4e-4 * light + 2e-5)
    fraction = noise_in(uint8_from_linear(np.clip(sensor, 0, 1).astype(np.float32)), 2.5)
    assert fraction[3:27, 3:-3].mean() > 0.8
    assert fraction[33:-3, 3:-3].mean() > 0.65


def test_noise_that_a_webcam_smooths_in_the_dark_is_still_noise_in_the_light() -> None:
    codes = np.full((ROWS * STEP, COLUMNS * STEP, 3), 120.0)
    codes[ROWS * STEP // 2 :] = 30
    fraction = noise_in(noisy(codes, 3.0), 2.5)
    assert fraction[3:27, 3:-3].mean() > 0.8


def test_what_a_turn_of_the_head_brings_to_sight_is_smoothed_too() -> None:
    person, near = EVERYWHERE.copy(), EVERYWHERE.copy()
    person[:, :30] = near[:, :15] = 0
    fraction = noise_in(noisy(dim_picture(), 4.0), 2.5, person, near=near)
    assert fraction[3:27, 18:30].mean() > 0.8
    assert fraction[:, :15].max() == 0


def test_beside_the_person_nothing_is_smoothed() -> None:
    person = EVERYWHERE.copy()
    person[:, :30] = 0
    fraction = noise_in(noisy(dim_picture(), 4.0), 2.5, person)
    assert fraction[:, :30].max() == 0
    assert fraction[3:27, 33:-3].mean() > 0.8


def test_a_person_of_a_few_cells_does_not_tell_the_noise_alone() -> None:
    """So nothing appears at once where a few cells begin to be in the dark."""
    image, one = noisy(dim_picture(), 4.0), np.zeros((ROWS, COLUMNS), np.float32)
    one[10, 10] = 1
    assert noise_in(image, 2.5, one).max() < 0.05


def test_noise_is_told_in_cells_of_one_pixel_too() -> None:
    image = noisy(np.full((ROWS, COLUMNS, 3), 40.0), 4.0)
    fraction = noise_in(image, 2.5, step=1)
    assert fraction.shape == (ROWS, COLUMNS)
    assert fraction.mean() > 0.7


def test_a_picture_without_noise_is_not_smoothed() -> None:
    assert noise_in(dim_picture().astype(np.uint8), 2.5)[33:-3].max() == 0


def test_smoothed_cells_have_hardly_any_noise() -> None:
    roots = root_of_light(np.full((ROWS, COLUMNS, 3), 0.1, np.float32))
    rough = roots + np.random.default_rng(6).normal(0, 0.02, roots.shape).astype(np.float32)
    assert smoothed(rough, UNIT)[5:-5, 5:-5].std() < 0.5 * 0.02
