from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.errors import LightsError
from relit_camera.capture.alignment import picture_set_alignment
from relit_camera.capture.alignment.outlier_pictures import predict_pictures
from relit_camera.capture.alignment.picture_set_alignment import align_samples, align_to_prediction, apply_alignment
from relit_camera.capture.alignment.rigid_transform import RigidTransform, transforms_to_array
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import direction_from_degrees
from tests.capture.film.moving_face_film import CIRCLE, SIZE, Move, moved, shading, texture, wandering

LIGHTS = [(azimuth, elevation) for elevation in (-30, 0, 30, 60) for azimuth in range(-60, 61, 20)]
DIRECTIONS = np.array([direction_from_degrees(*light) for light in LIGHTS])
BLACK, TORN, FOREIGN = 3, 10, 17


def disc() -> NDArray[np.float32]:
    x, y = np.arange(SIZE[0]) + 0.5, (np.arange(SIZE[1]) + 0.5)[:, None]
    return (np.hypot(x - CIRCLE.x, y - CIRCLE.y) < CIRCLE.radius).astype(np.float32)


def coloured(pictures: ArrayLike) -> NDArray[np.float32]:
    return np.repeat(np.asarray(pictures, np.float32)[..., None], 3, axis=-1)


@lru_cache
def scene() -> tuple[list[Move], NDArray[np.float64], NDArray[np.float32], NDArray[np.float32]]:
    """A face under 28 lights: how it lay, how strong the strobes were, the pictures, and what they should be."""
    rng = np.random.default_rng(4)
    still = np.stack([texture() * shading(*light) for light in LIGHTS])
    moves, strobes = wandering(28, seed=7, pixels=1.5, degrees=0.4), np.exp(rng.normal(0, 0.07, 28))
    moves = [moves[index] for index in rng.permutation(28)]
    strobes /= np.median(strobes)
    pictures = np.stack([moved(face, move) for face, move in zip(still, moves, strict=True)]) * strobes[:, None, None]
    pictures = (pictures + rng.normal(0, 0.003, pictures.shape)).clip(0)
    return moves, strobes, coloured(pictures), coloured(still)


def off(pictures: NDArray[np.float32], still: NDArray[np.float32]) -> float:
    """RMS difference in the face."""
    return float(np.sqrt(np.mean(np.square(pictures - still)[:, disc() > 0])))


@pytest.mark.slow
def test_motions_and_strengths_are_found() -> None:
    moves, strobes, pictures, still = scene()
    found = align_samples(pictures, DIRECTIONS, disc())
    left = transforms_to_array(found.transforms) - transforms_to_array(
        [RigidTransform(move.degrees, move.x, move.y).inverse() for move in moves]
    )
    # What goes with the light's direction cannot be told from shading: twelve of these 84 numbers, by chance.
    terms = np.column_stack([np.ones(28), DIRECTIONS])
    left -= terms @ np.linalg.lstsq(terms, left)[0]
    before = transforms_to_array([RigidTransform(move.degrees, move.x, move.y) for move in moves])
    assert np.sqrt(np.mean(left**2, axis=0)) == pytest.approx(0, abs=0.13)
    assert np.sqrt(np.mean(before**2, axis=0))[1:].max() > 0.5
    assert np.log(found.gains * strobes).std() < 0.02
    assert np.median(found.gains) == pytest.approx(1)
    assert found.rejected == {}
    assert found.correlation.min() > 0.9
    aligned = found.samples(OlatSamples(pictures, DIRECTIONS, disc()))
    assert aligned.pictures.dtype == np.float32
    assert off(aligned.pictures, still) < 0.5 * off(pictures, still)


@pytest.mark.slow
def test_a_set_that_lies_well_is_left_alone() -> None:
    _, _, _, still = scene()
    found = align_samples(still, DIRECTIONS, disc())
    assert np.abs(transforms_to_array(found.transforms)).max() < 0.2
    assert found.gains == pytest.approx(1, abs=0.02)


@pytest.mark.slow
def test_corrupt_pictures_are_named() -> None:
    _, _, pictures, still = scene()
    broken = pictures.copy()
    broken[BLACK] = 0.002
    broken[TORN, ::2] *= 0.1
    broken[FOREIGN] = coloured(moved(texture(seed=12, finest=6), wandering(1)[0])[::-1] * shading(60, -40))
    found = align_samples(broken, DIRECTIONS, disc())
    assert sorted(found.rejected) == [BLACK, TORN, FOREIGN]
    assert found.rejected[BLACK].startswith("black")
    assert found.rejected[TORN].startswith("torn")
    assert found.rejected[FOREIGN].startswith("unlike")
    aligned = found.samples(OlatSamples(broken, DIRECTIONS, disc()))
    np.testing.assert_array_equal(aligned.directions, DIRECTIONS[found.kept])
    assert off(aligned.pictures, still[found.kept]) < 0.5 * off(pictures, still)


def test_of_pictures_that_do_not_belong_together_nothing_is_made() -> None:
    pictures = np.zeros((9, *SIZE[::-1], 3), np.float32)
    pictures[:] = coloured(texture() * shading(0, 0))
    pictures[1:4] = 0
    directions = DIRECTIONS[[10, 9, 11, 4, 16, 17, 18, 3, 2]]
    samples = OlatSamples(pictures, directions, disc())
    with pytest.raises(LightsError, match="only 6 of 9 pictures fit together; give pictures of one thing"):
        align_samples(pictures, directions, disc()).samples(samples)


@pytest.mark.slow
def test_light_from_behind_keeps_its_strength() -> None:
    behind = np.array([direction_from_degrees(150, 10), direction_from_degrees(-140, 20)])
    _, _, _, still = scene()
    pictures = np.concatenate([still, 0.02 * still[:2]])
    found = align_samples(pictures, np.concatenate([DIRECTIONS, behind]), disc())
    assert found.gains[-2:].tolist() == pytest.approx([1, 1], abs=0.01)
    assert not found.rejected


@pytest.mark.parametrize("strength", [0.6, 1.5])
def test_one_picture_is_aligned_to_its_prediction(strength: float) -> None:
    moves, _, _, still = scene()
    for index in (2, 12, 24):
        picture = strength * coloured(moved(still[index, ..., 0], moves[index]))
        transform, gain = align_to_prediction(picture, still[index], disc())
        move = moves[index]
        left = transforms_to_array([transform]) - transforms_to_array(
            [RigidTransform(move.degrees, move.x, move.y).inverse()]
        )
        assert np.abs(left).max() < 0.1
        assert gain == pytest.approx(1 / strength, rel=0.02)
        assert off(apply_alignment(picture, transform, gain)[None], still[index][None]) < 0.02


@pytest.mark.slow
def test_large_pictures_are_measured_at_a_smaller_size(monkeypatch: pytest.MonkeyPatch) -> None:
    smaller = replace(picture_set_alignment.TUNABLES, largest_side_px=140)
    monkeypatch.setattr(picture_set_alignment, "TUNABLES", smaller)
    _, _, pictures, still = scene()
    found = align_samples(pictures, DIRECTIONS, disc())
    assert off(found.pictures(pictures), still) < 0.55 * off(pictures, still)


@pytest.mark.slow
def test_the_model_predicts_what_follows_its_law() -> None:
    _, _, _, still = scene()
    predicted = predict_pictures(still, DIRECTIONS, disc())
    error = np.abs(predicted - still[..., 0])[:, disc() > 0]
    assert predicted.shape == still.shape[:3]
    assert error.mean() < 0.02 * still.max()
    assert not predicted[:, disc() == 0].any()
    # A shadow that one picture alone has is not believed.
    shadowed = still.copy()
    shadowed[8, 140:160, 100:130] *= 0.2
    there = predict_pictures(shadowed, DIRECTIONS, disc())[8, 140:160, 100:130]
    np.testing.assert_allclose(there, predicted[8, 140:160, 100:130], atol=0.05)
