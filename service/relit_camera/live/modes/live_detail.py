"""How far a relit live picture leans on the live picture, and how far on the relit source image.

The product of the live picture and a ratio of light is only as good as the estimate of the room: where its light is
hard, the old shading shows through. The relit source image has no trace of the room, but it is coarse, and it lies on
the live face only as well as the landmarks do. So the coarse part of the shown picture is that of the relit source
image, and the detail is the live picture's: each of the two where it is better. Where the live picture has no detail to
trust, because it is overexposed or so dark that the ratio would multiply its noise, the source image gives that too.
Where the ratio makes noise visible, but the live picture is still the better one, what varies no more than its noise is
shown smooth (the filter of Lee, 1980, whose weight is that of Wiener).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import Box, DisplayImage
from relit_camera.base.images.light_multiplication import POWER, light_of_root, root_of_light

Cells = NDArray[np.float32]


@dataclass(frozen=True)
class LiveDetailTunables:
    """Constants, chosen on one rendered person (`bea` in docs/evaluate.md): in soft light and beside a window.

    `coarse` and `needed` were chosen in six rooms and two lights, where positions are aligned. `dark_noise` is from the
    noise of three rendered webcams' pictures.

    Attributes:
        coarse: sigma of what counts as coarse, in eye distances.
        needed: deviation of the person's coarse light from that of the relit source image, RMS of logarithms, at which
            half of it is corrected: less comes from landmarks that lie badly, more from a room that is hard to know.
        range: limits of the correction.
        floor: share of the person's mean light that is added to both sides of the correction.
        full_code, clipped_code: brightest code of a live pixel up to which its detail is trusted, and from which not.
        noise: root of the ratio at which half of the detail is trusted.
        mismatch, mismatch_face: logarithm of how much darker or brighter than expected a cell is that half counts as
            something else: beside the face, and inside it.
        mismatch_floor: share of the person's mean root below which differences do not count as such.
        wide: sigma of the neighborhood that tells what is expected, in eye distances.
        smooth: sigma of the live picture that is compared with what is expected, and shown in place of noise, in eye
            distances.
        visible_excess: by how much a root of the ratio exceeds 1 where half of the noise is suppressed.
        noise_fraction: of the cells whose noise could be seen, how many are taken to show nothing but noise.
        noise_margin: how many times the variance of noise counts as noise.
        dark_noise: root of light at which a webcam's sensor has as much noise of its own as of counted photons.
        noise_cells: so many cells must tell the noise; with fewer it is suppressed less.
    """

    coarse: float = 0.05
    needed: float = 0.25
    range: tuple[float, float] = (0.2, 5.0)
    floor: float = 0.02
    full_code: float = 232.0
    clipped_code: float = 252.0
    noise: float = 3.8
    mismatch: float = 0.5
    mismatch_face: float = 1.2
    mismatch_floor: float = 0.15
    wide: float = 0.6
    smooth: float = 0.03
    visible_excess: float = 0.3
    noise_fraction: float = 0.05
    noise_margin: float = 5.0
    dark_noise: float = 0.29
    noise_cells: int = 200


TUNABLES = LiveDetailTunables()


@dataclass(frozen=True)
class SourceCells:
    """What is known of the source image where the cells of the live picture look; all (rows, columns, 3 or none).

    Attributes:
        relit: roots of its light under the scene's light.
        under_room: the same under the room's, in the live frame's exposure.
        confidence: how far the ratio counts, 0..1.
        skin: how far a cell is on skin or hair that moves with the head: not lids, eyes, lips or what they show.
        face: how far it is inside the outline of the face.
        near: how far it is on the person or near their outline.
    """

    relit: Cells
    under_room: Cells
    confidence: Cells
    skin: Cells
    face: Cells
    near: Cells


@dataclass(frozen=True)
class CellBlend:
    """How the shown picture is made of the live one and the source image.

    Attributes:
        ratio: (rows, columns, 4) roots of the ratio times the confidence, and the confidence.
        trust: (rows, columns) how far the live picture's detail is shown, 0..1.
    """

    ratio: Cells
    trust: Cells


def shape_cells(source: SourceCells) -> CellBlend:
    """The ratio for each cell where of the source image only the shape is the person's: nothing of it is shown."""
    confidence = source.confidence
    weighted = cv2.merge([*(cv2.multiply(each, confidence) for each in cv2.split(_ratio(source))), confidence])
    return CellBlend(np.asarray(weighted, np.float32), np.ones(confidence.shape, np.float32))


def _ratio(source: SourceCells) -> Cells:
    ratio = cv2.divide(source.relit, np.maximum(source.under_room, _LEAST))
    return np.asarray(np.clip(ratio, *_RATIO_ROOTS), np.float32)


def blend_cells(live: Cells, smooth: Cells, brightest: Cells, source: SourceCells, unit: float) -> CellBlend:
    """Find the ratio for each cell of the live picture, and how far its detail can be trusted.

    Args:
        live: (rows, columns, 3) roots of the live picture's light.
        smooth: the same, see `smoothed`.
        brightest: (rows, columns) its brightest code there, 0..255.
        source: of the source image there.
        unit: the eye distance in cells.
    """
    tuning = TUNABLES
    clipped = np.clip((brightest - tuning.full_code) / (tuning.clipped_code - tuning.full_code), 0, 1)
    seen = source.skin * source.confidence * (1 - clipped)
    # Single noisy cells in the dark would else not match, and show.
    match = _match(smooth, clipped, source, seen, unit)
    confidence = source.confidence * match
    ratio = _ratio(source)
    ratio *= _correction(source.relit, live * ratio, seen * match, tuning.coarse * unit)
    amplified = (_largest(ratio) / np.float32(tuning.noise)) ** 2
    trust = (1 - clipped) / (1 + amplified * amplified)
    # Eyes and lips are the live picture's in any case; and each cell stands on few pixels, whose noise would flicker.
    trust = cv2.blur(1 - (1 - trust) * source.skin * np.minimum(_SURE * confidence, 1), (3, 3))
    weighted = cv2.merge([*(cv2.multiply(each, confidence) for each in cv2.split(ratio)), confidence])
    return CellBlend(np.asarray(weighted, np.float32), np.asarray(trust, np.float32))


def smoothed(live: Cells, unit: float) -> Cells:
    """Cells of the live picture, blurred so far that hardly any noise is left; `unit` is the eye distance in cells."""
    return np.asarray(cv2.GaussianBlur(live, (0, 0), max(TUNABLES.smooth * unit, _LEAST_SIGMA)), np.float32)


def noise_fraction(image: DisplayImage, step: int, box: Box, factor: Cells, source: SourceCells, unit: float) -> Cells:
    """How much of each cell's detail is noise that would be seen on the person or near them, (rows, columns), 0..1.

    Roots of light have about the same noise where it is that of counted photons, and more in the dark, where it is the
    sensor's own, unless the webcam smooths the dark. So one amount is taken from the calmest of those cells of the
    person where the factor would show it, once for noise that is the same everywhere and once for noise that grows in
    the dark by `dark_noise`; the larger counts.

    Args:
        image: the live picture.
        step: side of a cell in its pixels.
        box: left, top, right and bottom of the cells.
        factor: (rows, columns, 3) that roots of its light are multiplied by.
        source: of the source image there.
        unit: the eye distance in cells.
    """
    tuning = TUNABLES
    excess = cv2.max(_largest(factor) - 1, 0.0)
    excess = cv2.multiply(excess, excess)
    visible = cv2.divide(excess, cv2.add(excess, tuning.visible_excess**2))
    told = cv2.compare(cv2.multiply(visible, source.confidence), _VISIBLE, cv2.CMP_GT)
    told = cv2.bitwise_and(told, cv2.compare(source.skin, _STILL, cv2.CMP_GT)) > 0
    count = np.count_nonzero(told)
    if count == 0:
        return np.zeros(visible.shape, np.float32)
    brightness, variance = _moments(image, step, box, max(tuning.smooth * unit, _LEAST_SIGMA))
    # How many times the noise in the light a sensor's own noise makes it.
    more = cv2.divide(tuning.dark_noise**2, cv2.max(cv2.multiply(brightness, brightness), _DARKEST))
    more = cv2.add(more, 1.0)
    every = count // _NOISE_SAMPLES + 1
    sampled, expected = variance[told][::every], more[told][::every]
    even, growing = np.quantile([sampled, sampled / expected], tuning.noise_fraction, axis=1)
    margin = tuning.noise_margin * min(count / tuning.noise_cells, 1)
    noise = cv2.max(cv2.multiply(more, float(growing * margin)), float(even * margin))
    fraction = cv2.min(cv2.divide(noise, cv2.add(variance, 1e-9)), 1.0)
    return np.asarray(cv2.multiply(cv2.multiply(visible, source.near), fraction), np.float32)


def _moments(image: DisplayImage, step: int, box: Box, sigma: float) -> tuple[Cells, Cells]:
    """Mean and variance of roots of the live picture's green light round each cell, both (rows, columns).

    The variance from the difference of two pixels of each cell: shades that go on over several cells do not count.
    """
    green = _cell_part(image, step, box)[..., 1]
    one, other = step // 4, step // 4 + max(step // 2, 1)
    first, second = green[one::step, one::step], green[other::step, other::step]
    rows, columns = second.shape  # of cells of one pixel the last have no other
    codes = cv2.hconcat([np.ascontiguousarray(first[:rows, :columns]), np.ascontiguousarray(second)])
    roots = cv2.LUT(codes, _ROOTS_OF_CODES)
    first, second = roots[:, :columns], roots[:, columns:]
    difference = cv2.subtract(first, second)
    moments = cv2.merge([cv2.addWeighted(first, 0.5, second, 0.5, 0), cv2.multiply(difference, difference, scale=0.5)])
    left, top, right, bottom = box
    moments = cv2.copyMakeBorder(moments, 0, bottom - top - rows, 0, right - left - columns, cv2.BORDER_REPLICATE)
    mean, variance = cv2.split(cv2.GaussianBlur(moments, (0, 0), sigma))
    return np.asarray(mean, np.float32), np.asarray(variance, np.float32)


def _cell_part(image: DisplayImage, step: int, box: Box) -> DisplayImage:
    """The part of a live picture that a box of its cells of `step` pixels shows, without cells that are cut."""
    left, top, right, bottom = box
    rows, columns = min(bottom, image.shape[0] // step), min(right, image.shape[1] // step)
    return image[top * step : rows * step, left * step : columns * step]


def mean_of_channels(cells: Cells) -> Cells:
    """The mean of the three channels of cells (rows, columns, 3): (rows, columns)."""
    return np.asarray(cv2.transform(cells, np.full((1, 3), 1 / 3, np.float32)), np.float32)


def overexposed(brightest: Cells) -> NDArray[np.bool_]:
    """Which cells show nothing but that they are bright, by their brightest code, 0..255."""
    return np.asarray(brightest >= TUNABLES.clipped_code)


def live_cells(image: DisplayImage, step: int, box: Box) -> tuple[Cells, Cells]:
    """The live picture in cells of `step` pixels: roots of its light (rows, columns, 3), its brightest code there.

    The middle of each cell stands for it: what is made of cells is blurred. `box` is left, top, right and bottom of the
    cells that are wanted; what is of them beyond the picture repeats its border.
    """
    left, top, right, bottom = box
    part = _cell_part(image, step, box)
    rows, columns = (side // step for side in part.shape[:2])
    small = part if step == 1 else cv2.resize(part, (columns, rows), interpolation=cv2.INTER_LINEAR)
    small = cv2.copyMakeBorder(small, 0, bottom - top - rows, 0, right - left - columns, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.LUT(small, _ROOTS_OF_CODES), np.float32), _largest(small).astype(np.float32)


_ROOTS_OF_CODES = root_of_light(linear_from_uint8(np.arange(256, dtype=np.uint8)[None]))[0]
_RATIO_ROOTS = (0.02 ** (1 / POWER), 12 ** (1 / POWER))
"""Limits of the ratio: the source image is extrapolated while the head turns, and may have no light somewhere."""
_LEAST, _SURE = np.float32(1e-4), np.float32(1.5)
"""A least divisor; and what makes a confidence of two thirds count as certainty, since it is soft at the rim."""
_VISIBLE, _STILL = 0.3, 0.9
"""Cells tell the noise where it can be seen on the person, and not on lids, eyes or lips."""
_NOISE_SAMPLES = 1000
"""So many of these cells are looked at."""
_DARKEST = 0.008
"""Square of the least root of light that counts as brightness, about ten codes."""
_LEAST_SIGMA = 0.3
"""Of a blur, in cells; OpenCV takes 0 for something else."""
_NEAR = np.float32(0.02)
"""Mean weight in the neighborhood below which nobody knows what is expected."""
_ROBUST_ROUNDS, _REDUCTION = 2, 4
"""Of the expectation, which is so wide that it is computed for fewer cells, by a factor on each side."""


def _match(live: Cells, clipped: Cells, source: SourceCells, seen: Cells, unit: float) -> Cells:
    """How far each cell shows what the source image has there, 0..1; a hand or hair that moved is something else.

    Inside the face more is allowed: shadows that the room's estimate lacks fall there.
    """
    tuning = TUNABLES
    bright, known = mean_of_channels(live), mean_of_channels(source.under_room)
    mean = float((known * seen).sum()) / max(float(seen.sum()), 1e-6)
    least = np.float32(max(tuning.mismatch_floor * mean, 1e-3))
    apart = cv2.log((bright + least) / (known + least)) * np.float32(POWER)
    limit = tuning.mismatch + np.float32(tuning.mismatch_face - tuning.mismatch) * source.face
    rows, columns = apart.shape
    size = (max(columns // _REDUCTION, 1), max(rows // _REDUCTION, 1))
    few, goal, weight = (cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in (limit, apart, seen))
    error = goal
    for _ in range(_ROBUST_ROUNDS):
        counted = weight / (1 + (error / few) ** 2)
        sums = cv2.GaussianBlur(cv2.merge([goal * counted, counted]), (0, 0), tuning.wide * unit / _REDUCTION)
        error = goal - sums[..., 0] / (sums[..., 1] + np.float32(1e-6))
    expected, near = cv2.split(cv2.resize(sums, (columns, rows), interpolation=cv2.INTER_LINEAR))
    error = (apart - expected / (near + np.float32(1e-6))) * (near / (near + _NEAR))
    # An overexposed cell may be brighter than it seems.
    error = np.where(error < 0, error * (1 - clipped), error)
    return np.asarray(1 / (1 + (error / limit) ** 2), np.float32)


def _correction(goal: Cells, found: Cells, weight: Cells, sigma: float) -> Cells:
    """By what roots `found` are multiplied so that their coarse light is that of `goal`, as far as both differ much."""
    rows, columns = weight.shape
    size = (-(-columns // 2), -(-rows // 2))
    goal, found, weight = (cv2.resize(each, size, interpolation=cv2.INTER_LINEAR) for each in (goal, found, weight))
    weights = cv2.merge([weight] * 3)
    total = max(float(weight.sum()), 1e-6)
    coarse = []
    for roots in (goal, found):
        light = cv2.multiply(light_of_root(np.asarray(roots, np.float32)), weights)
        floor = np.maximum(TUNABLES.floor * np.array(cv2.sumElems(light)[:3]) / total, 1e-6)
        coarse.append(cv2.add(cv2.GaussianBlur(light, (0, 0), sigma / 2), (*floor, 0.0)))
    logarithm = cv2.log(np.clip(cv2.divide(*coarse), *TUNABLES.range))
    deviation = sum(cv2.sumElems(cv2.multiply(cv2.multiply(logarithm, logarithm), weights))) / (3 * total)
    share = 1 / (1 + (TUNABLES.needed**2 / max(deviation, 1e-9)) ** 2)
    roots = cv2.exp(cv2.multiply(logarithm, (share / POWER,) * 4))
    return np.asarray(cv2.resize(roots, (columns, rows), interpolation=cv2.INTER_LINEAR), np.float32)


def _largest(image: NDArray) -> NDArray:
    """The largest of each pixel's three channels, (height, width)."""
    first, second, third = cv2.split(image)
    return np.asarray(cv2.max(cv2.max(first, second), third))
