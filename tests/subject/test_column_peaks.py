"""The peaks of texels and lights, by which the errors of a compressed field are allowed."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.subject.compression.column_peaks import SAMPLE_LINES, light_peaks, texel_peaks
from relit_camera.subject.compression.field_tiles import TILE_WIDTH
from relit_camera.subject.reflectance_field import TEXELS


@dataclass
class TwoTermField:
    """Answers every texel with the sum of a dim picture and a bright one, in shares that the texel has.

    Attributes:
        pictures: (2, height, width).
        shares: (2048,) of the bright picture.
        asked: numbers of pixels that were asked for.
    """

    pictures: NDArray[np.float32]
    shares: NDArray[np.float32]
    asked: list[int] = field(default_factory=list)

    @property
    def size(self) -> tuple[int, int]:
        return self.pictures.shape[2], self.pictures.shape[1]

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        self.asked.append(stop - start)
        dim, bright = self.pictures.reshape(2, -1)[:, start:stop]
        rows = dim[:, None] * (1 - self.shares) + bright[:, None] * self.shares
        return np.repeat(rows[..., None], 3, axis=2)


@pytest.fixture
def pool() -> Iterator[ThreadPoolExecutor]:
    with worker_pool() as made:
        yield made


def inside_of(height: int, width: int) -> NDArray[np.bool_]:
    """An ellipse."""
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    return (x**2 + y**2 < 0.9).ravel()


def spotted(height: int, width: int, radius: float) -> TwoTermField:
    """An even gray, and beside the middle a round spot of this radius, eight times as bright under the last texels."""
    y, x = np.mgrid[:height, :width]
    spot = np.hypot(y - 0.4 * height, x - 0.6 * width) < radius
    pictures = np.stack([np.ones((height, width)), 1 + 7 * spot]).astype(np.float32)
    return TwoTermField(pictures, np.linspace(0, 1, TEXELS, dtype=np.float32))


@pytest.mark.slow
@pytest.mark.parametrize(("height", "width", "radius"), [(160, 160, 16), (96, 300, 14), (400, 300, 34)])
def test_a_bright_spot_is_seen(height: int, width: int, radius: float, pool: ThreadPoolExecutor) -> None:
    """One of a few percent of the pixels, which few clusters of 128 have."""
    made, inside = spotted(height, width, radius), inside_of(height, width)
    bright = np.percentile(made.pictures[1].ravel()[inside], 99.5)
    assert bright == pytest.approx(8)
    truth = 1 + (bright - 1) * made.shares
    found = texel_peaks(made, inside, pool)
    np.testing.assert_allclose(found, truth, rtol=0.01)
    assert max(made.asked) <= TILE_WIDTH
    assert sum(made.asked) <= 2 * SAMPLE_LINES * width


def test_what_chance_shows_too_much_of_does_not_count(pool: ThreadPoolExecutor) -> None:
    """A spot that one line crosses: its texels' peak is the gray's, or they had an error eight times as large."""
    made, inside = spotted(160, 160, 1.5), inside_of(160, 160)
    assert texel_peaks(made, inside, pool).max() == pytest.approx(1)


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_few_lines_are_enough(rows: int, pool: ThreadPoolExecutor) -> None:
    made = spotted(rows, 20, 0)
    np.testing.assert_allclose(texel_peaks(made, np.ones(rows * 20, bool), pool), 1)


def test_lights_are_known(pool: ThreadPoolExecutor) -> None:
    captured = np.random.default_rng(0).gamma(0.3, 1, (5, 40, 30, 3)).astype(np.float32)
    inside = inside_of(40, 30)
    expected = [np.percentile(picture.reshape(-1, 3)[inside], 99.5) for picture in captured]
    np.testing.assert_allclose(light_peaks(captured, inside, pool), expected, rtol=1e-6)
