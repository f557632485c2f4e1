"""Skin and light from one picture: the light is where it is, and nobody's skin is made another's."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from relit_camera.base.array_types import Float64Array
from relit_camera.base.images.color import LUMINANCE
from relit_camera.capture.instant.instant_capture import TUNABLES
from relit_camera.capture.instant.room_light import fit_room_light
from relit_camera.capture.instant.skin.skin_albedo import estimate_albedo
from relit_camera.face.skin_prior import DARKEST, LIGHTEST, SKIN, estimate_skin, skin_of_luminance
from relit_camera.light.directions import direction_from_degrees, texel_directions
from tests.capture.instant.lit_person import SIDE, field_of, person, window
from tests.capture.instant.lit_person import SKIN as ALBEDO

TONES = np.geomspace(float(LIGHTEST @ LUMINANCE), float(DARKEST @ LUMINANCE), 6)


def seen_skin(albedo: Float64Array, light: Float64Array) -> np.ndarray:
    """Pixels of skin in light that varies over a face as it does."""
    shading = np.random.default_rng(5).uniform(0.5, 1.0, (500, 1))
    return (albedo * light * shading).astype(np.float32)


@pytest.mark.parametrize("luminance", TONES)
def test_every_tone_keeps_its_own_brightness(luminance: float) -> None:
    """In a well exposed room nobody's luminance is off by more than a third."""
    albedo = skin_of_luminance(float(luminance))
    found = estimate_skin(seen_skin(albedo, np.full(3, SKIN.facing_light / 0.86)), SKIN.mid_gray)
    assert float(found @ LUMINANCE) / luminance == pytest.approx(1, abs=0.34)
    np.testing.assert_allclose(found / found.sum(), albedo / albedo.sum(), atol=0.02)


def test_darker_people_in_one_room_come_out_darker() -> None:
    light = np.full(3, 0.8)
    found = [float(estimate_skin(seen_skin(skin_of_luminance(each), light), 0.2) @ LUMINANCE) for each in TONES]
    assert all(after < 0.85 * before for before, after in pairwise(found))


@pytest.mark.parametrize("luminance", TONES[1:-1])
def test_how_bright_the_room_is_shown_tells_light_from_skin(luminance: float) -> None:
    """One person in one room, twice as much exposure: the picture is twice as bright, the skin nearly the same."""
    albedo = skin_of_luminance(float(luminance))
    dim, bright = (
        float(estimate_skin(seen_skin(albedo, np.full(3, level)), level * 0.25) @ LUMINANCE) for level in (0.5, 1.0)
    )
    assert bright / dim < 1.45


def test_the_tint_of_a_room_is_the_rooms() -> None:
    warm = np.array([1.25, 1.0, 0.72])
    plain, tinted = (estimate_skin(seen_skin(ALBEDO, light), 0.18) for light in (np.ones(3), warm))
    shift = np.abs(np.log((tinted / tinted[1]) / (plain / plain[1])))
    assert (shift < 0.3 * np.abs(np.log(warm)) + 1e-3).all()


@pytest.mark.parametrize("known_room", [True, False])
def test_bright_eye_whites_tell_dark_skin(known_room: bool) -> None:
    """One picture of skin, exposed for the face: whose eyes are much brighter is darker, the more so in no room."""
    seen = seen_skin(ALBEDO, np.ones(3))
    frame = 0.18 if known_room else None
    dark, light = (float(estimate_skin(seen, frame, ratio) @ LUMINANCE) for ratio in (2.0, 0.8))
    assert dark < (0.85 if known_room else 0.55) * light


def test_tones_are_named_by_their_luminance() -> None:
    for luminance in TONES:
        assert float(skin_of_luminance(float(luminance)) @ LUMINANCE) == pytest.approx(luminance, rel=1e-3)
    np.testing.assert_allclose(skin_of_luminance(5.0), LIGHTEST, rtol=1e-3)
    np.testing.assert_allclose(skin_of_luminance(1e-6), DARKEST, rtol=1e-3)


@pytest.mark.parametrize(("azimuth", "elevation"), [(-60, 20), (0, 40), (50, 0)])
def test_the_light_is_found_where_it_is(azimuth: float, elevation: float) -> None:
    shape, response = person()
    light = window(azimuth, elevation)
    picture = field_of(ALBEDO).pictures(light[None])[0].reshape(SIDE // 2, 2, SIDE // 2, 2, 3).mean(axis=(1, 3))
    picture += np.random.default_rng(0).normal(0, 0.004, picture.shape).astype(np.float32)
    found = fit_room_light(response, picture, shape.skin, ALBEDO)
    vectors = texel_directions().reshape(-1, 3)
    main = found.sum(axis=1) @ vectors
    expected = direction_from_degrees([azimuth], [elevation])[0]
    assert np.degrees(np.arccos(main @ expected / np.linalg.norm(main))) < 20
    relit = field_of(ALBEDO).pictures(found[None])[0]
    truth = field_of(ALBEDO).pictures(light[None])[0]
    skin = shape.skin.repeat(2, axis=0).repeat(2, axis=1)
    assert np.abs(relit - truth)[skin].mean() < 0.04 * truth[skin].mean()


def test_a_colored_light_is_found_in_its_color() -> None:
    shape, response = person()
    light = window(30) * np.array([1.0, 0.6, 0.3], np.float32)
    picture = field_of(ALBEDO).pictures(light[None])[0][::2, ::2]
    found = fit_room_light(response, picture, shape.skin, ALBEDO).sum(axis=0)
    np.testing.assert_allclose(found / found[0], [1.0, 0.6, 0.3], rtol=0.1)


def test_marks_on_the_skin_are_albedo_and_a_harsh_room_is_told() -> None:
    shape, response = person()
    skin = shape.skin.repeat(2, axis=0).repeat(2, axis=1)
    marked = field_of(ALBEDO)
    marks = np.ones((SIDE, SIDE, 1), np.float32)
    marks[60:66, 44:50] = 0.5
    fractions = {}
    for name, light in {"soft": window(20), "harsh": window(85, 5, 30, around=0.0)}.items():
        lit = response.spread(np.concatenate([response.diffuse @ light, response.glossy @ light], axis=1))
        lit = lit.reshape(SIDE, SIDE, 6)
        picture = marked.albedo * marks * lit[..., :3] + lit[..., 3:]
        found = estimate_albedo(picture, lit[..., :3], lit[..., 3:], skin)
        fractions[name] = found.dark_fraction
        if name == "soft":
            ratio = found.albedo[62:64, 46:48].mean() / found.albedo[62:64, 52:56].mean()
            assert ratio == pytest.approx(0.5, abs=0.06)
            assert np.median(found.albedo[skin], axis=0) == pytest.approx(ALBEDO, rel=0.1)
    assert fractions["soft"] < 0.02
    assert fractions["harsh"] > 0.18 > TUNABLES.harsh_dark_fraction
