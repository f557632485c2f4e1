"""What a screen cannot show of a person: hair, which the room's light tells, and eyes and glasses, which mirror it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.array_types import Float32Array
from relit_camera.capture.desk.person.mirror_mask import MAX_FRACTION, suppress_mirrored_patches
from relit_camera.capture.desk.person.room_gain import TUNABLES, room_gain
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.environments.builtin.builtin_environments import builtin_environment
from relit_camera.subject.reflectance_field import texel_vectors
from tests.capture.desk.desk_person import SIZE, LambertianField, lambertian_person

DIRECTIONS = np.array([[x, y, 1.0] for x in (-0.4, 0, 0.4) for y in (-0.2, 0.2)])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


def relit(field: LambertianField, environment: str) -> Float32Array:
    light = builtin_environment(environment).light_map.reshape(-1, 3) * texel_solid_angles().reshape(-1, 1)
    seen = np.einsum("lpc,lc->pc", field.at(texel_vectors(), np.arange(SIZE**2)), light)
    return np.asarray(seen.reshape(SIZE, SIZE, 3), np.float32)


@pytest.mark.slow
@pytest.mark.parametrize("environment", ["window", "overcast"])
def test_hair_is_as_bright_as_in_the_room(environment: str) -> None:
    """A field whose hair is too dark by half becomes right; that of the skin stays, whatever the picture's exposure."""
    person = lambertian_person()
    assert isinstance(person.field, LambertianField)
    hair = np.zeros((SIZE, SIZE), bool)
    hair[:26] = True
    too_dark = replace(person.field, albedo=person.field.albedo * np.where(hair, 0.5, 1).reshape(-1, 1))
    inside = person.matte > 0.5
    gain = room_gain(too_dark, 7 * relit(person.field, environment), inside & ~hair, person.matte)
    assert gain is not None
    gain = gain.reshape(SIZE, SIZE, 3) / np.median(gain.reshape(SIZE, SIZE, 3)[inside & ~hair])
    assert np.median(gain[:22][inside[:22]]) == pytest.approx(2, rel=0.15)
    assert np.percentile(np.abs(gain[inside & ~hair] - 1), 90) < 0.2
    assert gain.max() < TUNABLES.most / TUNABLES.least


def test_a_room_without_light_tells_nothing() -> None:
    person = lambertian_person()
    skin = person.matte > 0.5
    assert room_gain(person.field, np.zeros((SIZE, SIZE, 3), np.float32), skin, person.matte) is None


def lit_one_by_one() -> tuple[Float32Array, Float32Array]:
    """The person under each of six distant lights, and the matte."""
    person = lambertian_person()
    pictures = person.field.at(DIRECTIONS, np.arange(SIZE**2)).reshape(-1, SIZE, SIZE, 3)
    return np.asarray(pictures, np.float32), person.matte


def test_an_eye_that_mirrors_a_patch_is_found_and_dimmed() -> None:
    pictures, matte = lit_one_by_one()
    spot = np.s_[40:42, 38:40]
    mirrored = pictures.copy()
    mirrored[2][spot] = 3.0
    _, rims = suppress_mirrored_patches(pictures, DIRECTIONS, matte)
    calm, mask = suppress_mirrored_patches(mirrored, DIRECTIONS, matte)
    assert mask[spot].all()
    assert (mask & ~rims).sum() < 30
    assert calm[2][spot].max() < 1
    np.testing.assert_array_equal(calm[:, ~mask], mirrored[:, ~mask])


def test_what_is_most_of_the_person_is_no_glasses() -> None:
    pictures, matte = lit_one_by_one()
    half = matte > 0.5
    half[:, SIZE // 2 :] = False
    assert half.sum() > 2 * MAX_FRACTION * (matte > 0.5).sum()
    mirrored = pictures.copy()
    mirrored[2][half] = 3.0
    calm, mask = suppress_mirrored_patches(mirrored, DIRECTIONS, matte)
    assert calm is mirrored
    assert not mask.any()
