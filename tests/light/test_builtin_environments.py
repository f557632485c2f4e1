"""The built-in environments: proper light, of the character that their names promise."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.base.images.color import LUMINANCE
from relit_camera.light.directions import direction_from_degrees, texel_directions
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.light.environments.builtin.builtin_thumbnails import builtin_thumbnail, drawn_thumbnail
from relit_camera.light.environments.builtin.canvas import bearings, directions
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_camera.light.environments.panorama_axes import between_map_and_viewer_axes
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import irradiance, total


def reading(name: str, azimuth: float, elevation: float = 10) -> np.ndarray:
    """RGB of a white diffuse surface that faces AZ, EL, as displayed."""
    light_map = builtin_environment(name).light_map
    return irradiance(light_map, direction_from_degrees(azimuth, elevation)) * auto_exposure_scale(light_map)


def bright(rgb: np.ndarray) -> float:
    return float(rgb @ LUMINANCE)


def test_the_canvas_turns_into_map_axes() -> None:
    np.testing.assert_allclose(between_map_and_viewer_axes(directions()), texel_directions(512, 1024), atol=1e-6)
    bearing, elevation = bearings()
    right = directions()[(bearing > 45) & (bearing < 135) & (np.abs(elevation) < 30)]
    assert (right[:, 0] > 0.5).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_each_is_light(name: str) -> None:
    environment = builtin_environment(name)
    radiance = environment.panorama.radiance
    assert radiance.shape == (512, 1024, 3)
    assert radiance.dtype == np.float32
    assert np.isfinite(radiance).all()
    assert radiance.min() >= 0
    np.testing.assert_allclose(total(environment.light_map), total(radiance), rtol=5e-4)  # kept in 16 bits


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_each_wraps_at_its_sides(name: str) -> None:
    # The sides lie in front, between lamps: nothing bright may be cut there.
    radiance = np.log1p(builtin_environment(name).panorama.radiance)
    middle = radiance.shape[1] // 2
    cut = np.abs(radiance[:, middle] - radiance[:, middle - 1]).mean()
    typical = np.abs(np.diff(radiance, axis=1)).mean()
    assert cut < 4 * typical + 0.005


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_each_thumbnail_of_the_package_is_what_is_drawn(name: str) -> None:
    kept, drawn = (
        cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        for data in (builtin_thumbnail(name), drawn_thumbnail(name))
    )
    assert kept is not None
    assert drawn is not None
    cure = "write them again: python -m relit_camera.light.environments.builtin.builtin_thumbnails"
    assert np.abs(kept.astype(int) - drawn).mean() < 1.5, cure  # JPEG encoders differ
    assert len(builtin_thumbnail(name)) < 10_000


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_each_light_map_of_the_package_is_the_painted_one_s(name: str) -> None:
    painted = builtin_environment(name).light_map
    cure = "write them again: python -m relit_camera.light.environments.builtin.builtin_light_maps"
    # Processors round differently: by less than a hundred thousandth of the brightest.
    np.testing.assert_allclose(builtin_light_map(name), painted, rtol=1e-4, atol=1e-5 * painted.max(), err_msg=cure)


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_each_thumbnail_shows_something(name: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    data = EnvironmentStore(tmp_path_factory.mktemp("store")).thumbnail(name)
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert picture.std() > 15
    assert 20 < np.median(picture) < 220
    assert (picture > 250).mean() < 0.15


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_each_lights_a_face(name: str) -> None:
    assert bright(reading(name, 0, 0)) == pytest.approx(0.8, rel=0.01)
    assert max(bright(reading(name, azimuth)) for azimuth in (-60, 60)) < 2.5


def test_studio_has_its_key_on_the_left_and_a_fill() -> None:
    assert 2 < bright(reading("studio", -50)) / bright(reading("studio", 50)) < 8


def test_the_window_lights_from_the_left_and_is_tall_and_bright() -> None:
    assert bright(reading("window", -70)) > 2 * bright(reading("window", 70))
    red, _, blue = reading("window", -70)
    assert red / blue == pytest.approx(1, abs=0.2)


def test_sunset_is_warm_from_the_right_and_cooler_away_from_it() -> None:
    warm, cool = reading("sunset", 60), reading("sunset", -120)
    assert bright(warm) > 1.8 * bright(cool)
    assert warm[0] / warm[2] > 2 * cool[0] / cool[2]


def test_the_street_is_warm_on_one_side_and_neon_on_the_other() -> None:
    shop, neon = reading("night-street", -60), reading("night-street", 90)
    assert shop[0] > shop[1] > shop[2]
    assert neon[2] > neon[1]


def test_the_party_has_two_colours() -> None:
    left, right = reading("party", -70), reading("party", 70)
    assert left[0] > 3 * left[1]
    assert right[2] > 3 * right[0]


def test_overcast_light_is_soft_neutral_and_from_above() -> None:
    assert bright(reading("overcast", -60)) == pytest.approx(bright(reading("overcast", 60)), rel=0.1)
    assert bright(reading("overcast", 0, 90)) > 2 * bright(reading("overcast", 0, -90))
    up = reading("overcast", 0, 90)
    assert up.max() / up.min() < 1.2
    down = reading("overcast", 0, -90)
    assert down[1] > down[0] > down[2]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(KeyError):
        builtin_environment("beach")
    with pytest.raises(KeyError):
        builtin_light_map("beach")
