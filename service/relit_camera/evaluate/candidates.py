"""What is compared with the truth: methods on the captured pictures, or a built subject."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relit_camera.reflectance.black_ring import with_black_ring
from relit_camera.reflectance.method import LinearMethod, Method, method_names, open_method
from relit_camera.reflectance.samples import Samples
from relit_camera.space.directions import MAP_HEIGHT, MAP_WIDTH, map_position_from_direction
from relit_camera.subject.field import ExactField, ReflectanceField
from relit_camera.subject.subject import Subject

RINGED = "barycentric"
"""The method that is shown with the black ring too."""
RING = f"{RINGED} + black ring"
"""Name of the thesis's extension (5.6) of its own interpolation."""

_BLOCK = 1024
"""Pixels of a dense field taken at a time: 25 MB."""

Lookup = Callable[[NDArray[np.float64], NDArray[np.intp]], NDArray[np.float32]]


@dataclass(frozen=True)
class Candidate:
    """Something that answers light from any direction, at the pixels inside a matte.

    Attributes:
        name: shown to people.
        inside: row-major indices (pixels,) of those pixels.
        answer: unit vectors (count, 3), row-major pixel indices (some,) → linear colours (count, some, 3).
    """

    name: str
    inside: NDArray[np.intp]
    answer: Lookup

    def pictures_at(self, directions: NDArray[np.float64]) -> NDArray[np.float32]:
        """Colours (count, pixels, 3) under unit light from each of the unit vectors (count, 3)."""
        return self.answer(directions, self.inside)

    def maps_at(self, directions: NDArray[np.float64], places: NDArray[np.intp]) -> NDArray[np.float32]:
        """Colours (places, count, 3) of some pixels, given by their place in `inside`, under each light."""
        return np.ascontiguousarray(self.answer(directions, self.inside[places]).transpose(1, 0, 2))


def method_candidates(samples: Samples, inside: NDArray[np.intp], names: Sequence[str] = ()) -> list[Candidate]:
    """A candidate for each named method, all that are installed unless given, and for the thesis's black ring.

    Args:
        samples: captured pictures.
        inside: row-major indices of the pixels to be answered for.
        names: as `open_method` knows them; the ring's own name too.

    Raises:
        NotFoundError: one is not installed.
    """
    candidates = []
    for name in names or _all_names():
        used = with_black_ring(samples) if name == RING else samples
        method = open_method(RINGED if name == RING else name)
        candidates.append(Candidate(name, inside, _lookup(method, used)))
    return candidates


def _all_names() -> list[str]:
    installed = method_names()
    return [*installed, RING] if RINGED in installed else installed


def _lookup(method: Method, samples: Samples) -> Lookup:
    """Of the method's field, which is built when it is first asked."""
    field = cache(lambda: method.build(samples))

    def answer(directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        built = field()
        return built.at(directions, pixels) if isinstance(built, ExactField) else _read(built, directions, pixels)

    return answer


def _read(field: ReflectanceField, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
    """Colours (count, some, 3) of a field that knows texels only: its map is read between their centres."""
    lookup = map_lookup(directions)
    pictures = np.empty((len(directions), len(pixels), 3), np.float32)
    order = np.argsort(pixels)
    for start in range(0, len(pixels), _BLOCK):
        chosen = order[start : start + _BLOCK]
        first, last = int(pixels[chosen[0]]), int(pixels[chosen[-1]])
        # Pixels of a matte lie close together, chosen spots do not: never the dense field of all between them.
        block = (
            field.dense(first, last + 1)[pixels[chosen] - first]
            if last - first < 4 * _BLOCK
            else np.concatenate([field.dense(int(pixel), int(pixel) + 1) for pixel in pixels[chosen]])
        )
        by_texel = block.transpose(1, 0, 2).reshape(block.shape[1], -1)
        pictures[:, chosen] = (lookup @ by_texel).reshape(len(directions), len(chosen), 3)
    return pictures


def subject_candidate(name: str, subject: Subject, inside: NDArray[np.intp]) -> Candidate:
    """A subject as its file holds it, compressed.

    Args:
        name: to show.
        subject: of the truth's size.
        inside: row-major indices of the pixels to be answered for.

    Raises:
        NotFoundError: the method that built it is not installed.
    """
    method = open_method(subject.metadata.method)

    def answer(directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        if isinstance(method, LinearMethod):
            weights = method.weights(subject.light_directions.astype(np.float64), directions)
            amounts = subject.light_coefficients @ weights
        else:
            amounts = (map_lookup(directions) @ subject.coefficients.T).T
        return subject.basis.at(np.asarray(amounts, np.float32), pixels)

    return Candidate(name, inside, answer)


def map_lookup(directions: NDArray[np.float64]) -> csr_array:
    """Bilinear interpolation on the 64 × 32 map as a matrix (count, 2048); at a texel's centre, that texel alone."""
    row, column = map_position_from_direction(directions)
    row = np.clip(row, 0, MAP_HEIGHT - 1)
    # A centre's position may come out a rounding error short of its integer.
    top, left = np.floor(row + 1e-9).astype(int), np.floor(column + 1e-9).astype(int)
    down, right = np.maximum(row - top, 0), np.maximum(column - left, 0)
    entries = []
    for row_step, row_share in ((0, 1 - down), (1, down)):
        for column_step, column_share in ((0, 1 - right), (1, right)):
            texel = np.minimum(top + row_step, MAP_HEIGHT - 1) * MAP_WIDTH + (left + column_step) % MAP_WIDTH
            entries.append((row_share * column_share, texel))
    values, texels = (np.concatenate(part) for part in zip(*entries, strict=True))
    rows = np.tile(np.arange(len(directions)), len(entries))
    return csr_array((values, (rows, texels)), shape=(len(directions), MAP_HEIGHT * MAP_WIDTH))
