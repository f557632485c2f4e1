"""Light on the mannequin."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_quality import psnr
from relit_camera.light.directions import direction_from_degrees, fibonacci_directions
from relit_studio.mannequin.rendering.distant_lights import DistantLights, lights_from_map
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View
from relit_studio.mannequin.shape.figure import Posture

SIZE = 96


@pytest.fixture(scope="module")
def view() -> View:
    return View(Posture(), Camera(SIZE))


def halves(picture: np.ndarray) -> tuple[float, float]:
    light = luminance(picture)
    return float(light[:, : SIZE // 2].sum()), float(light[:, SIZE // 2 :].sum())


def test_light_from_the_right_lights_the_right(view: View) -> None:
    left, right = halves(view.under_light([1, 0, 0]))
    assert right > 4 * left
    left, right = halves(view.under_light([-1, 0, 0]))
    assert left > 4 * right


def test_light_from_above_lights_the_hair_and_from_below_the_chin(view: View) -> None:
    above, below = (luminance(view.under_light(direction_from_degrees(0, el))) for el in (75, -60))
    assert above[: SIZE // 6].sum() > 2 * below[: SIZE // 6].sum()
    chin = slice(int(0.64 * SIZE), int(0.76 * SIZE))
    middle = slice(SIZE // 2 - 4, SIZE // 2 + 4)
    assert below[chin, middle].mean() > 3 * above[chin, middle].mean()


def test_light_from_behind_shows_only_a_rim(view: View) -> None:
    behind, front = view.under_light([0, 0.3, -0.954]), view.under_light([0, 0, 1])
    assert behind.sum() < 0.05 * front.sum()
    assert behind.min() >= 0


def test_one_light_is_albedo_times_cosine_where_nothing_shades(view: View) -> None:
    inside = view.matte() > 0.999
    direction = direction_from_degrees(20, 15)
    cosine = np.maximum(view.normals() @ direction, 0)
    lambert = view.albedo() * cosine[..., None]
    picture = view.under_light(direction)
    ratio = luminance(picture)[inside] / np.maximum(luminance(lambert)[inside], 1e-3)
    facing = cosine[inside] > 0.6
    # Gloss adds a few percent; shadows of nose, brow and chin take a few places away.
    assert np.median(ratio[facing]) == pytest.approx(1.04, abs=0.05)
    assert np.mean(np.abs(ratio[facing] - 1) < 0.15) > 0.8


@pytest.mark.slow
def test_many_lights_add_up(view: View) -> None:
    directions = fibonacci_directions(6)
    power = np.arange(1, 7)[:, None] * np.array([0.1, 0.2, 0.3])
    together = view.under_lights(DistantLights(directions, power))
    apart = sum(view.under_lights(DistantLights(d[None], p[None])) for d, p in zip(directions, power, strict=True))
    np.testing.assert_allclose(together, apart, atol=1e-5)
    sharp = sum(view.under_light(d) * p.astype(np.float32) for d, p in zip(directions, power, strict=True))
    assert psnr(together, sharp, view.matte()) > 26


@pytest.mark.slow
def test_soft_light_hardly_depends_on_how_many_lights_stand_for_it(view: View) -> None:
    white = np.ones((32, 64, 3), np.float32)
    few, many = (view.under_lights(lights_from_map(white, count)) for count in (32, 160))
    assert psnr(few, many, view.matte()) > 30


def test_matte_and_depth(view: View) -> None:
    matte, depth = view.matte(), view.depth()
    assert matte.shape == depth.shape == (SIZE, SIZE)
    assert matte[SIZE // 2, SIZE // 2] == 1
    assert matte[0].max() == 0
    assert 0.35 < matte.mean() < 0.75
    assert ((matte > 0) & (matte < 1)).any()
    nose = np.unravel_index(depth.argmax(), depth.shape)
    assert abs(nose[1] - SIZE / 2) < 3
    assert depth.max() == pytest.approx(7.5, abs=0.5)
    assert (depth[matte == 0] == 0).all()
    assert (view.under_light([0, 0, 1])[matte == 0] == 0).all()


def test_the_same_posture_gives_the_same_picture(view: View) -> None:
    again = View(Posture(), Camera(SIZE))
    light = direction_from_degrees(-40, 25)
    np.testing.assert_array_equal(view.under_light(light), again.under_light(light))
