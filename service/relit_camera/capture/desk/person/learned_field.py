"""What rendered people taught about the field of a desk capture: how far to believe it, and what to add.

A screen lights a face from the front. Where light from elsewhere goes is told by two answers: the model that was fitted
to the screen's pictures, whose normals glasses, beards and dark skin lead astray, and the generic head, painted with
the colors that the screen showed. A small network says for each place on a face which share of the first to take, and
which harmonics of light to add to the mixture.

It sees what both answer in units of what the screen showed there, where the place lies on the head, and how bright it
is beside the person's skin; no color, and how dark skin is only by what share of its light gloss has.

`python -m relit_studio learn` trains it (docs/studio.md); its card is in docs/models.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import Mask, Points
from relit_camera.capture.instant.head_shape import HeadShape, fit_head_shape
from relit_camera.capture.instant.response.generic_reflectance import (
    GenericField,
    ShapeResponse,
    gloss_amounts,
    shape_response,
)
from relit_camera.capture.instant.response.learned_response import (
    LEAST_SHARE,
    PLACE_SIGNS,
    harmonic_measure,
    head_places,
    with_learned_response,
)
from relit_camera.capture.instant.response.response_network import (
    DEGREE,
    HARMONICS,
    ResponseNetwork,
    Signs,
    harmonic_signs,
    read_network,
)
from relit_camera.light.directions import fibonacci_directions
from relit_camera.light.spherical_harmonics import basis, texel_basis
from relit_camera.subject.reflectance_field import ExactField, texel_vectors

BELIEVED = np.float32(0.5)
"""Share of what the network says that is done. For rendered people all of it would be best; on the faces of the
Extended Yale Face Database B half of it is better than all (docs/evaluate.md)."""
LEAST_DIFFUSE = np.float32(0.3)
"""Share of a pixel's brightness that is not gloss, at least."""
LEAST_FRONT = np.float32(0.05)
"""Least response to the screen that the generic head is taken to have, lest its albedo grow without limit."""
DARKEST = 0.1
"""Of skin's brightness: what is darker counts as this bright, since its relative errors are large."""
LOGARITHMS = -2.5, 1.5
"""Limits of the natural logarithm of a pixel's brightness relative to skin."""
EDGE_PX = 2.0
"""Standard deviation of the blur between skin and the rest."""
_ROUND = fibonacci_directions(256)
_BLOCK = 2048


@lru_cache(maxsize=1)
def learned_network() -> ResponseNetwork:
    """The network that comes with the program."""
    return read_network(Path(__file__).with_name("learned_field.npz"), input_signs(), output_signs())


def input_signs() -> Signs:
    """Signs (23,) of the network's inputs: place, harmonics of both answers, brightness, and gloss's share of it."""
    return np.concatenate([PLACE_SIGNS, harmonic_signs(), harmonic_signs(), np.ones(2, np.float32)])


def output_signs() -> Signs:
    """Signs (10,) of the network's outputs: the harmonics to add, and the logit of the measured field's share."""
    return np.append(harmonic_signs(), np.float32(1))


@dataclass(frozen=True, eq=False)
class PaintedHead:
    """The generic head with the colors that the measured lights show it to have.

    Attributes:
        response: how the head answers light (pixels, 2048), as heads of its kind do.
        front: (pixels,) its mean response to the measured lights.
        gloss: (pixels,) amount of gloss, 1 on a face.
        shiny: (pixels,) what of the measured lights is gloss.
    """

    response: ShapeResponse
    front: Float32Array
    gloss: Float32Array
    shiny: Float32Array

    def albedo(self, level: Float32Array) -> Float32Array:
        """The albedo (pixels, channels) with which the head is as bright as `level` under the measured lights."""
        return diffuse_albedo(level, self.front, self.shiny)

    def answer(self, level: Float32Array, weights: Float32Array) -> Float32Array:
        """What it sends (pixels, count) under lights (2048, count), its pixels being as bright as `level` (pixels,)."""
        albedo = self.albedo(level[:, None])
        return np.asarray(
            albedo * (self.response.diffuse @ weights) + self.gloss[:, None] * (self.response.glossy @ weights)
        )


def diffuse_albedo(level: Float32Array, front: Float32Array, shiny: Float32Array) -> Float32Array:
    """Albedo (pixels, channels) of pixels as bright as `level`, of which `shiny` (pixels,) is gloss."""
    diffuse = np.maximum(level - shiny[:, None], LEAST_DIFFUSE * level)
    return np.asarray(diffuse / np.maximum(front, LEAST_FRONT)[:, None], np.float32)


def paint_head(shape: HeadShape, matte: Mask, directions: NDArray[np.float64]) -> PaintedHead:
    """The head that is painted by lights (count, 3) from before it.

    Args:
        shape: the generic head, of the matte's size.
        matte: (height, width) of the person.
        directions: of the measured lights.
    """
    response = with_learned_response(shape_response(shape.geometry, shape.certainty, matte), shape, matte)
    nearest = (directions @ texel_vectors().T).argmax(axis=1)
    gloss = gloss_amounts(shape.face, 0.01 * matte.shape[1]).ravel()[response.pixels]
    front, shiny = (each[:, nearest].mean(axis=1) for each in (response.diffuse, response.glossy))
    return PaintedHead(response, front, gloss, gloss * shiny)


@dataclass(frozen=True, eq=False)
class Mixture:
    """What the network says of the pixels of a response.

    Attributes:
        share: (pixels,) of the measured field, 0..1; the rest is the painted head's.
        added: (pixels, 9) harmonics to add, in units of the pixel's brightness under the measured lights.
    """

    share: Float32Array
    added: Float32Array


def skin_brightness(painted: PaintedHead, shape: HeadShape, level: Float32Array) -> float:
    """The median luminance of bare skin among colors (pixels, 3) of the painted head's pixels.

    Raises:
        CaptureError: no bare skin is seen.
    """
    found = luminance(level)[shape.skin.ravel()[painted.response.pixels]]
    if len(found) == 0 or not np.median(found) > 0:
        raise CaptureError("no bare skin is seen of the person", "take from your face what covers it")
    return float(np.median(found))


def mixture_inputs(
    painted: PaintedHead,
    shape: HeadShape,
    matte: Mask,
    level: Float32Array,
    measured: ExactField,
    pixels: NDArray[np.intp],
) -> Float32Array:
    """What the network sees of the painted head's pixels: (pixels, 23) float32.

    Args:
        painted: the generic head.
        shape: its shape.
        matte: (height, width) of the person, of the shape's size.
        level: (pixels, 3) colors under the measured lights.
        measured: the field.
        pixels: (pixels,) of the field at these places, row-major.

    Raises:
        CaptureError: no bare skin is seen.
    """
    skin = skin_brightness(painted, shape, level)
    bright = luminance(brightened(level, skin))
    measure = (basis(_ROUND, DEGREE) * (4 * np.pi / len(_ROUND))).astype(np.float32)
    harmonics = np.empty((len(pixels), HARMONICS), np.float32)
    for start in range(0, len(pixels), _BLOCK):
        part = slice(start, start + _BLOCK)
        harmonics[part] = luminance(measured.at(_ROUND, pixels[part])).T @ measure
    logarithm = np.clip(np.log(bright / skin), *LOGARITHMS)
    answers = painted.answer(bright, harmonic_measure()) / bright[:, None], harmonics / bright[:, None]
    places = head_places(painted.response.pixels, shape, matte)
    return np.column_stack([places, *answers, logarithm, np.minimum(painted.shiny / bright, 1)]).astype(np.float32)


def mixture(inputs: Float32Array) -> Mixture:
    """What the network says of `mixture_inputs`, as far as it is believed."""
    outputs = learned_network().outputs(inputs)
    share = expit(outputs[:, -1])
    return Mixture(np.asarray(1 - BELIEVED * (1 - share), np.float32), BELIEVED * outputs[:, :-1])


@dataclass(frozen=True, eq=False)
class LearnedField:
    """A measured field, mixed with the painted head and corrected.

    Attributes:
        measured: the field of the screen's pictures.
        painted: the generic head's, of the same size.
        share: (height · width, 1) of the measured one.
        added: (height · width, 9) harmonics, in units of `level`.
        level: (height · width, 3) the person under the measured lights.
    """

    measured: ExactField
    painted: GenericField
    share: Float32Array
    added: Float32Array
    level: Float32Array

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.painted.size

    def dense(self, start: int, stop: int) -> Float32Array:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        pixels = np.arange(start, stop)
        added = self.added[pixels] @ texel_basis(DEGREE).astype(np.float32).T
        return mix(
            self.measured.dense(start, stop),
            self.painted.rows(pixels),
            self.share[pixels, :, None],
            added[..., None] * self.level[pixels, None],
        )


def mix(measured: Float32Array, painted: Float32Array, share: Float32Array, added: Float32Array) -> Float32Array:
    """What a share of one answer and the rest of another send, and what is added, which takes never all.

    All are of one shape or broadcast to it: lights, pixels and channels in any order.
    """
    mixed = painted + share * (measured - painted)
    return np.asarray(np.maximum(mixed + added, LEAST_SHARE * mixed), np.float32)


@dataclass(frozen=True, eq=False)
class TwoAnswers:
    """What the measured field and the painted head answer, at half the picture's resolution.

    Attributes:
        shape: the generic head.
        painted: the same with colors; its pixels are those below.
        pixels: (pixels,) row-major ones of the whole resolution, the upper left of each four that are one of the half.
        level: (height · width, 3) the person under the measured lights, at the whole resolution.
        inputs: (pixels, 23) what the network sees.
    """

    shape: HeadShape
    painted: PaintedHead
    pixels: NDArray[np.intp]
    level: Float32Array
    inputs: Float32Array


def two_answers(measured: ExactField, directions: NDArray[np.float64], landmarks: Points, matte: Mask) -> TwoAnswers:
    """The answers of a measured field and of the generic head; arguments and errors as `with_learned_field`."""
    height, width = matte.shape
    if height % 2 or width % 2:
        raise ValueError(f"a picture of {width}x{height} has no half size")
    half = np.asarray(cv2.resize(matte, (width // 2, height // 2), interpolation=cv2.INTER_AREA), np.float32)
    shape = fit_head_shape((landmarks / 2).astype(np.float32), half)
    painted = paint_head(shape, half, directions)
    y, x = np.divmod(painted.response.pixels, width // 2)
    pixels = 2 * y * width + 2 * x
    level = np.zeros((height * width, 3), np.float32)
    inside = np.union1d(np.flatnonzero(matte.ravel() > 0), pixels)
    for start in range(0, len(inside), _BLOCK):
        block = inside[start : start + _BLOCK]
        level[block] = measured.at(directions, block).mean(axis=0)
    inputs = mixture_inputs(painted, shape, half, level[pixels], measured, pixels)
    level = brightened(level, skin_brightness(painted, shape, level[pixels]))
    return TwoAnswers(shape, painted, pixels, level, inputs)


def brightened(level: Float32Array, skin: float) -> Float32Array:
    """Colors (pixels, 3), those darker than `DARKEST` of skin with so much gray that they are as bright as that."""
    missing = np.maximum(DARKEST * np.float32(skin) - luminance(level), 0)
    return np.asarray(level + missing[:, None], np.float32)


def on_face(skin: Mask, shape: HeadShape) -> Mask:
    """Where the network is asked (height, width), 0..1: what has skin's color, and the face with all that is on it.

    Args:
        skin: (height, width) mask of what has skin's color, 0..1.
        shape: the generic head, of the same size or half of it.
    """
    face = cv2.resize(shape.face.astype(np.float32), skin.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.GaussianBlur(np.maximum(skin, face), (0, 0), EDGE_PX), np.float32)


def with_learned_field(
    measured: ExactField, directions: NDArray[np.float64], landmarks: Points, skin: Mask, matte: Mask
) -> LearnedField:
    """A measured field, corrected as far as fields of its kind are wrong; off skin and face it stays as it is.

    Args:
        measured: in units in which a white wall has 1; of even sides.
        directions: (count, 3) of the measured lights.
        landmarks: (478, 2) of the scheme `mesh478` in its picture.
        skin: (height, width) mask of what has skin's color, 0..1.
        matte: (height, width) of the person.

    Raises:
        CaptureError: no head fits, or no bare skin is seen.
    """
    height, width = matte.shape
    answers = two_answers(measured, directions, landmarks, matte)
    painted, response = answers.painted, answers.painted.response
    found = mixture(answers.inputs)
    asked = on_face(skin, answers.shape).ravel()[answers.pixels]
    planes = 1 - asked * (1 - found.share), asked[:, None] * found.added, painted.front, painted.shiny, painted.gloss
    larger = response.spread(np.column_stack(planes).astype(np.float32))
    share, added, (front, shiny, gloss) = larger[:, :1], larger[:, 1 : 1 + HARMONICS], larger[:, 1 + HARMONICS :].T
    albedo = diffuse_albedo(answers.level, front, shiny)
    generic = GenericField(response, albedo.reshape(height, width, 3), gloss.reshape(height, width))
    return LearnedField(measured, generic, share, np.ascontiguousarray(added), answers.level)
