"""Compression by local bases: what is asked is reached, by independent measure, whatever the field."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.images.image_quality import psnr
from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.methods.shadow_aware_interpolation import SharpVisibilityInterpolation
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.light.environments.environment_panorama import read_panorama
from relit_camera.light.light_map import LightMap, resample_to_light_map
from relit_camera.subject.compression.accuracy_target import DARK_LIGHT_FRACTION, CompressionTarget
from relit_camera.subject.compression.field_compression import CompressedField, _largest_threshold, compress_field
from relit_camera.subject.compression.field_tiles import CLUSTER_PIXELS, TILE_HEIGHT, TILE_WIDTH, tiles
from relit_camera.subject.compression.principal_components import PixelCluster
from relit_camera.subject.reflectance_field import TEXELS, ReflectanceField
from tests.lab.lit_sphere import cap, shadowed
from tests.subject.handmade_basis import rows_by_hand

pytestmark = pytest.mark.slow

SIZE = 48
MAP = builtin_light_map("sunset")
TARGET = CompressionTarget(texel_db=42, light_db=45, maps=[MAP])


@dataclass
class Counted:
    """A field that notes which pixels were asked for."""

    field: ReflectanceField
    asked: list[int] = field(default_factory=list)

    @property
    def size(self) -> tuple[int, int]:
        return self.field.size

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        self.asked.append(stop - start)
        return self.field.dense(start, stop)


@pytest.fixture(scope="module")
def samples() -> OlatSamples:
    """A ball with a sharp shadow, coloured at random."""
    made = shadowed(cap(60, 60), SIZE)
    albedo = np.random.default_rng(0).uniform(0.2, 1, (SIZE, SIZE, 3)).astype(np.float32)
    return replace(made, pictures=made.pictures * albedo)


@pytest.fixture(scope="module")
def dense(samples: OlatSamples) -> NDArray[np.float32]:
    """The field (pixels, 2048, 3): hard shadow edges, no sum of few pictures."""
    return SharpVisibilityInterpolation().build(samples).dense(0, SIZE**2)


@pytest.fixture(scope="module")
def found(samples: OlatSamples) -> CompressedField:
    return compress_field(SharpVisibilityInterpolation().build(samples), samples.pictures, samples.matte, TARGET)


@pytest.fixture(scope="module")
def rows(found: CompressedField) -> NDArray[np.float64]:
    """The row of every pixel and channel, by the definition: (pixels, 3, components)."""
    return rows_by_hand(found.basis, SIZE**2)


def picture(colours: NDArray) -> NDArray[np.float32]:
    return np.ascontiguousarray(colours, np.float32).reshape(SIZE, SIZE, 3)


def test_every_texel_and_light_comes_back_as_asked(
    samples: OlatSamples, dense: NDArray[np.float32], found: CompressedField, rows: NDArray[np.float64]
) -> None:
    restored = (rows @ found.coefficients).transpose(0, 2, 1)
    inside = samples.matte.ravel() > 0.5
    peaks = np.percentile(dense[inside].transpose(1, 0, 2).reshape(TEXELS, -1), 99.5, axis=1)
    peaks = np.maximum(peaks, DARK_LIGHT_FRACTION * peaks.max())
    error = np.mean((restored - dense)[inside] ** 2, axis=(0, 2))
    worst = -10 * np.log10((error / peaks**2).max())
    assert worst > TARGET.texel_db
    # It tells what it reached; the peaks, by which that is judged, are those of every fourth pixel.
    assert found.quality.texel_db == pytest.approx(worst, abs=0.7)
    lights = (rows @ found.light_coefficients).transpose(2, 0, 1)
    each = [psnr(picture(a), b, samples.matte) for a, b in zip(lights, samples.pictures, strict=True)]
    assert min(each) > TARGET.light_db - 0.5
    assert found.quality.light_db == pytest.approx(min(each), abs=0.1)


def psnr_under(
    light_map: LightMap,
    samples: OlatSamples,
    dense: NDArray[np.float32],
    found: CompressedField,
    rows: NDArray[np.float64],
) -> float:
    weighted = (light_map * texel_solid_angles()[..., None]).reshape(TEXELS, 3)
    restored = np.einsum("pcg,gl,lc->pc", rows, found.coefficients, weighted, optimize=True)
    expected = np.einsum("plc,lc->pc", dense, weighted, optimize=True)
    return psnr(picture(restored), picture(expected), samples.matte)


def test_the_worst_map_is_told(
    samples: OlatSamples, dense: NDArray[np.float32], found: CompressedField, rows: NDArray[np.float64]
) -> None:
    reached = psnr_under(MAP, samples, dense, found, rows)
    assert found.quality.map_db == pytest.approx(reached, abs=0.1)
    assert reached > 45


def test_real_places_that_it_was_not_tried_on_come_back(
    shared: Path,
    samples: OlatSamples,
    dense: NDArray[np.float32],
    found: CompressedField,
    rows: NDArray[np.float64],
) -> None:
    """Suns, soft boxes, a single bright pixel."""
    files = sorted((shared / "light").glob("*.hdr"))
    assert files
    maps = {file.stem: resample_to_light_map(read_panorama(file).radiance) for file in files}
    reached = {name: psnr_under(light_map, samples, dense, found, rows) for name, light_map in maps.items()}
    assert min(reached.values()) > 45, reached


def test_it_is_small_and_black_outside(samples: OlatSamples, found: CompressedField, rows: NDArray[np.float64]) -> None:
    kept = found.basis.nbytes + found.coefficients.nbytes + found.light_coefficients.nbytes
    assert found.quality.bytes_share == pytest.approx(kept / (SIZE**2 * 3 * TEXELS * 4))
    assert not rows[samples.matte.ravel() == 0].any()


@pytest.mark.parametrize("power", [0.5, 1.0, 1.6])
@pytest.mark.parametrize("wanted", [0.5, 3.0, 7000.0, 2e5])
def test_the_largest_threshold_is_found_in_few_steps(wanted: float, power: float) -> None:
    tried: list[float] = []

    def error(threshold: float) -> float:
        tried.append(threshold)
        return 0.55 * (threshold / wanted) ** power * (1 + 0.002 * np.sin(30 * np.log(threshold)))

    found = _largest_threshold(error, 0.55)
    assert 0.975 * 0.55 < error(found) <= 0.55
    assert len(tried) <= 7


@pytest.mark.parametrize(("error", "found"), [(0.6, 1e-2), (0.1, 1e6)])
def test_where_every_threshold_is_too_large_it_is_the_least_and_else_the_largest(error: float, found: float) -> None:
    assert _largest_threshold(lambda threshold: error, 0.55) == pytest.approx(found, rel=0.02)


def test_more_is_kept_where_more_is_asked(samples: OlatSamples, found: CompressedField) -> None:
    better = compress_field(
        SharpVisibilityInterpolation().build(samples), samples.pictures, samples.matte, CompressionTarget(50, 53)
    )
    assert better.quality.texel_db > found.quality.texel_db + 5
    assert len(better.basis.values) > 1.2 * len(found.basis.values)
    assert better.quality.map_db is None


def test_a_field_of_low_rank_needs_no_more_components_than_it_has(samples: OlatSamples) -> None:
    """Barycentric weights: no more independent answers than lights."""
    counted = Counted(SphericalBarycentric().build(samples))
    low = compress_field(counted, samples.pictures, samples.matte)
    assert low.basis.components <= len(samples.directions)
    assert low.quality.texel_db > 43
    # Never the whole at once.
    assert max(counted.asked) <= TILE_WIDTH


def test_progress_runs_to_the_end(samples: OlatSamples) -> None:
    told: list[tuple[int, int]] = []
    compress_field(
        SphericalBarycentric().build(samples),
        samples.pictures,
        samples.matte,
        progress=lambda done, total: told.append((done, total)),
    )
    assert told == [(i + 1, SIZE // TILE_HEIGHT) for i in range(SIZE // TILE_HEIGHT)]


def test_one_cluster_is_enough() -> None:
    few = shadowed(cap(40, 60), 8)
    one = compress_field(SphericalBarycentric().build(few), few.pictures, few.matte, TARGET)
    assert len(np.concatenate(tiles(few.matte))) == 1
    assert one.quality.light_db > TARGET.light_db
    assert one.quality.texel_db > TARGET.texel_db


def test_clusters_hold_every_pixel_inside_once_and_neighbours_together() -> None:
    matte = np.zeros((50, 600), np.float32)
    matte[3:47, 100:560] = 0.3
    clusters = np.concatenate(tiles(matte))
    pixels = [np.unique(cluster) for cluster in clusters]
    np.testing.assert_array_equal(np.sort(np.concatenate(pixels)), np.flatnonzero(matte))
    assert clusters.shape[1] == CLUSTER_PIXELS
    for each in pixels:
        assert np.ptp(each // 600) < TILE_HEIGHT
        assert np.ptp(each % 600) <= 2 * CLUSTER_PIXELS / TILE_HEIGHT + 8


def test_what_eight_bits_leave_is_kept_where_it_counts() -> None:
    """One strong component and a faint one: below the strong one's rounding, above the threshold."""
    rng = np.random.default_rng(0)
    strong = np.outer(rng.normal(size=60), rng.normal(size=300))
    faint = 1e-3 * np.outer(rng.normal(size=60), rng.normal(size=300))
    rows = (strong + faint).astype(np.float32)
    components = PixelCluster(rows).components(threshold=1e-3)
    assert components.codes.dtype == np.int8
    assert np.sum((components.restored() - rows) ** 2) < 0.2 * np.sum(faint**2)
    assert len(components.codes) > 2
    np.testing.assert_allclose(components.energies[0], np.sum(strong**2), rtol=0.02)
    coarse = PixelCluster(rows).components(threshold=1.0)
    assert len(coarse.codes) < len(components.codes)
    assert np.sum((coarse.restored() - rows) ** 2) > 0.5 * np.sum(faint**2)
