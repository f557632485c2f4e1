"""The display scale: a white ball facing the camera reads 0.8."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from relit_camera.base.config.look import Lamp
from relit_camera.base.images.color import LUMINANCE
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import irradiance
from relit_camera.light.scene_light import lamp_light_map


@given(st.floats(1e-3, 1e3), st.tuples(*[st.floats(0.1, 1)] * 3))
def test_even_light_of_any_strength_and_colour_reads_the_same(strength: float, colour: tuple[float, ...]) -> None:
    light_map = np.full((32, 64, 3), strength * np.array(colour), np.float32)
    reading = irradiance(light_map, (0, 0, 1)) * auto_exposure_scale(light_map)
    assert float(reading @ LUMINANCE) == pytest.approx(0.8, rel=1e-4)


def test_a_frontal_lamp_of_unit_irradiance_is_scaled_by_0_8() -> None:
    assert auto_exposure_scale(lamp_light_map([Lamp(azimuth_deg=0, elevation_deg=0)])) == pytest.approx(0.8, rel=1e-3)


def test_a_lamp_from_the_side_counts_by_its_cosine() -> None:
    assert auto_exposure_scale(lamp_light_map([Lamp(azimuth_deg=60, elevation_deg=0)])) == pytest.approx(1.6, rel=0.01)


def test_light_from_behind_alone_stays_finite() -> None:
    behind = lamp_light_map([Lamp(azimuth_deg=180, elevation_deg=0)])
    assert auto_exposure_scale(behind) == pytest.approx(16, rel=0.01)
    # As a lamp goes round, the scale rises to that and no further, without a step.
    scales = [auto_exposure_scale(lamp_light_map([Lamp(azimuth_deg=a, elevation_deg=0)])) for a in range(0, 181, 2)]
    assert max(scales) < 16.1
    assert np.diff(scales).min() > -0.05
    assert np.diff(scales).max() < 8


def test_no_light_stays_dark() -> None:
    assert auto_exposure_scale(np.zeros((32, 64, 3), np.float32)) == 1
