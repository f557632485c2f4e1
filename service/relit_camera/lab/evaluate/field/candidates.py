"""Candidates of an evaluation: reflectance methods on captured pictures, or a built subject."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.reflectance.directional_light import bilinear_map_lookup, directional_coefficients
from relit_camera.capture.reflectance.method_registry import ReflectanceMethod, method_names, open_method
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.reflectance.sampled_region import with_black_ring
from relit_camera.subject.reflectance_field import ExactField, ReflectanceField
from relit_camera.subject.subject import Subject

BASELINE_METHOD = "barycentric"
"""The method that is shown with the black ring too."""
BLACK_RING_METHOD = f"{BASELINE_METHOD} + black ring"
"""Name of the baseline method with black samples around the captured region (thesis 5.6)."""

_PIXEL_BLOCK = 1024
"""Pixels of a dense field taken at a time: 25 MB."""

Predictor = Callable[[NDArray[np.float64], NDArray[np.intp]], NDArray[np.float32]]


@dataclass(frozen=True)
class Candidate:
    """Predictor of the person's colors under light from any direction, at the pixels inside a matte.

    Attributes:
        name: shown to people.
        inside: row-major indices (pixels,) of those pixels.
        predict: unit vectors (count, 3), row-major pixel indices (some,) → linear colors (count, some, 3).
    """

    name: str
    inside: NDArray[np.intp]
    predict: Predictor

    def pictures_at(self, directions: NDArray[np.float64]) -> NDArray[np.float32]:
        """Colors (count, pixels, 3) under unit light from each of the unit vectors (count, 3)."""
        return self.predict(directions, self.inside)

    def maps_at(self, directions: NDArray[np.float64], places: NDArray[np.intp]) -> NDArray[np.float32]:
        """Colors (places, count, 3) of some pixels, given by their place in `inside`, under each light."""
        return np.ascontiguousarray(self.predict(directions, self.inside[places]).transpose(1, 0, 2))


def method_candidates(samples: OlatSamples, inside: NDArray[np.intp], names: Sequence[str] = ()) -> list[Candidate]:
    """Candidates for the named methods; by default for all installed ones and the baseline with the black ring.

    Args:
        samples: captured pictures.
        inside: row-major indices of the pixels to be answered for.
        names: of installed methods, or `BLACK_RING_METHOD`.

    Raises:
        NotFoundError: one is not installed.
    """
    candidates = []
    for name in names or _all_names():
        used = with_black_ring(samples) if name == BLACK_RING_METHOD else samples
        method = open_method(BASELINE_METHOD if name == BLACK_RING_METHOD else name)
        candidates.append(Candidate(name, inside, _method_predictor(method, used)))
    return candidates


def _all_names() -> list[str]:
    installed = method_names()
    return [*installed, BLACK_RING_METHOD] if BASELINE_METHOD in installed else installed


def _method_predictor(method: ReflectanceMethod, samples: OlatSamples) -> Predictor:
    """Predictor of a method; its field is built at the first call."""
    field = cache(lambda: method.build(samples))

    def predict(directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        built = field()
        return (
            built.at(directions, pixels)
            if isinstance(built, ExactField)
            else _interpolate_texels(built, directions, pixels)
        )

    return predict


def _interpolate_texels(
    field: ReflectanceField, directions: NDArray[np.float64], pixels: NDArray[np.intp]
) -> NDArray[np.float32]:
    """Colors (count, some, 3) of a field that is defined at texels only, interpolated bilinearly between them."""
    lookup = bilinear_map_lookup(directions)
    pictures = np.empty((len(directions), len(pixels), 3), np.float32)
    order = np.argsort(pixels)
    for start in range(0, len(pixels), _PIXEL_BLOCK):
        chosen = order[start : start + _PIXEL_BLOCK]
        first, last = int(pixels[chosen[0]]), int(pixels[chosen[-1]])
        # Few pixels that lie far apart are read one by one: the dense field of all pixels between them is too large.
        block = (
            field.dense(first, last + 1)[pixels[chosen] - first]
            if last - first < 4 * _PIXEL_BLOCK
            else np.concatenate([field.dense(int(pixel), int(pixel) + 1) for pixel in pixels[chosen]])
        )
        by_texel = block.transpose(1, 0, 2).reshape(block.shape[1], -1)
        pictures[:, chosen] = (lookup @ by_texel).reshape(len(directions), len(chosen), 3)
    return pictures


def subject_candidate(name: str, subject: Subject, inside: NDArray[np.intp]) -> Candidate:
    """Candidate of a subject, compressed as in its file.

    Args:
        name: to show.
        subject: of the truth's size.
        inside: row-major indices of the pixels to be answered for.

    Raises:
        NotFoundError: the method that built it is not installed.
    """
    method = open_method(subject.metadata.method)

    def predict(directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        return subject.basis.at(directional_coefficients(subject, method, directions), pixels)

    return Candidate(name, inside, predict)
