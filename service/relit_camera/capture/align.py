"""Pictures under one light each, made to fit one another: small rigid motions and strobes of varying strength undone.

Motion by what pictures under similar light predict of each other; strength, and which pictures are corrupt, by a model
of shading fitted to all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.shading_model import predict_pictures
from relit_camera.capture.stabilise.dense import Template
from relit_camera.capture.stabilise.predicted import align_pictures, visible_detail, without_border
from relit_camera.capture.stabilise.rigid import Rigid, move_picture, rigids_of, rows_of
from relit_camera.capture.unfit_pictures import likeness_of, unfit_pictures
from relit_camera.errors import LightsError
from relit_camera.reflectance.samples import Samples
from relit_camera.space.colour import luminance
from relit_camera.space.images import LinearImage, Mask

Floats = NDArray[np.float32]

_LARGEST_SIDE = 256
"""Larger pictures are scaled down to this."""
_ROUNDS = 3
_SHADE = 0.02
"""Of the mean light: darkness in which differences no longer count for more."""
_LIT, _SATURATED = 0.3, 0.97
"""Pixels from which a gain is told: brighter than this share of the predicted picture's bright ones, darker than that
of the set's brightest."""
_LEAST_SEEN = 0.1
"""Of what is predicted; darker is in shadow."""
_LEAST_LIT = 100
_FARTHEST = 0.04
"""Of the longer side: nothing that keeps still goes farther."""
LEAST_KEPT = 8
"""Fewer pictures cannot tell motion from shading."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """How the pictures of a set lie to each other.

    Attributes:
        transforms: for each picture, to where the face is on average; none for those rejected.
        gains: (lights,) factors that make up for strobes of varying strength; the median of those in front is 1. Light
            from behind keeps its strength.
        likeness: (lights,) correlation with what is predicted for the light, -1 to 1; 0 for those rejected.
        rejected: index and reason of pictures that no light could make.
    """

    transforms: tuple[Rigid, ...]
    gains: NDArray[np.float64]
    likeness: NDArray[np.float64]
    rejected: Mapping[int, str]

    @property
    def kept(self) -> NDArray[np.intp]:
        """Growing indices of the pictures that are not rejected."""
        return np.setdiff1d(np.arange(len(self.gains)), list(self.rejected))

    def pictures(self, pictures: Floats) -> Floats:
        """All pictures (lights, height, width, channels), each moved and multiplied by its gain."""
        moved = zip(pictures, self.transforms, self.gains.tolist(), strict=True)
        return np.stack([apply_alignment(*each) for each in moved])

    def samples(self, samples: Samples) -> Samples:
        """The samples that it was made of, aligned, without those rejected.

        Raises:
            LightsError: fewer than eight are left.
        """
        if len(self.kept) < LEAST_KEPT:
            what = f"only {len(self.kept)} of {len(self.gains)} pictures fit together"
            raise LightsError(what, "give pictures of one thing that keeps still, and the directions of their lights")
        return Samples(self.pictures(samples.pictures)[self.kept], samples.directions[self.kept], samples.matte)


def align_samples(
    pictures: Floats,
    directions: NDArray[np.float64],
    matte: Mask,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Alignment:
    """How pictures of one person under one light each lie to each other.

    Args:
        pictures: (lights, height, width, 3) float32 linear.
        directions: (lights, 3) unit vectors toward the lights.
        matte: (height, width) where the person is.
        progress: called with rounds of alignment done and their total.
    """
    small, inside, scale = scaled_down(pictures, matte)
    light, count = luminance(small), len(pictures)
    rejected = unfit_pictures(light, predict_pictures(small, directions, inside), directions, inside)
    kept = np.setdiff1d(np.arange(count), list(rejected))
    transforms, gains, likeness = [Rigid()] * count, np.ones(count), np.zeros(count)
    if len(kept) >= LEAST_KEPT:
        found = align_pictures(light[kept], inside, rounds=_ROUNDS, progress=progress)
        for index, each in zip(kept, _without_drift(found, directions[kept]), strict=True):
            transforms[index] = each
        moved = np.stack([apply_alignment(small[index], transforms[index]) for index in kept])
        predicted = predict_pictures(moved, directions[kept], inside)
        gains[kept] = _gains(luminance(moved), predicted, directions[kept], inside)
        likeness[kept] = likeness_of(luminance(moved), predicted, inside)
    return Alignment(tuple(each.scaled(1 / scale) for each in transforms), gains, likeness, rejected)


def scaled_down(pictures: Floats, matte: Mask) -> tuple[Floats, Mask, float]:
    """Pictures (lights, height, width, 3) and matte as small as they are compared, and by what factor, 1 at most."""
    scale = min(1.0, _LARGEST_SIDE / max(matte.shape))
    return np.stack([_resized(picture, scale) for picture in pictures]), _resized(matte, scale), scale


def align_to(picture: LinearImage, predicted: LinearImage, matte: Mask) -> tuple[Rigid, float]:
    """The transform and then the gain that take one picture nearest to a prediction of it.

    Args:
        picture: (height, width, 3) float32 linear.
        predicted: the same.
        matte: (height, width) where the person is.

    Returns:
        The transform, none where it would lead far away; and the factor that makes up for the strobe, after it: the
        median over lit pixels, as `align_samples` finds it. Least squares would take shadows in the wrong place for a
        weak strobe.
    """
    scale = min(1.0, _LARGEST_SIDE / max(matte.shape))
    here, there = luminance(_resized(picture, scale)), luminance(_resized(predicted, scale))
    inside = _resized(matte, scale)
    here *= np.float32((there * inside).sum() / max(float((here * inside).sum()), 1e-9))
    shade = _SHADE * float(there.mean()) + 1e-9
    template = Template(visible_detail(there, shade), without_border(inside), same_light=False)
    transform = template.align(visible_detail(here, shade), Rigid()).scaled(1 / scale)
    if np.hypot(transform.x, transform.y) > _FARTHEST * max(matte.shape):
        transform = Rigid()
    return transform, _gain(luminance(apply_alignment(picture, transform)), luminance(predicted), matte, np.inf)


def apply_alignment(picture: Floats, transform: Rigid, gain: float = 1.0) -> Floats:
    """A picture (height, width[, channels]) moved and multiplied; never negative."""
    moved = picture if transform == Rigid() else move_picture(picture, transform)
    return np.maximum(moved, 0) * np.float32(gain)


def _without_drift(transforms: list[Rigid], directions: NDArray[np.float64]) -> list[Rigid]:
    """Motion less the part that is linear in the light's direction.

    Under light from one side features seem to lie to that side: their shading moves, they do not. Where nothing moves
    that is most of what is measured; what really moves has little reason to go with the light.
    """
    rows = rows_of(transforms)
    terms = np.column_stack([np.ones(len(rows)), directions])
    return rigids_of(rows - terms @ np.linalg.lstsq(terms, rows)[0])


def _gains(light: Floats, predicted: Floats, directions: NDArray[np.float64], matte: Mask) -> NDArray[np.float64]:
    """Factors (lights,) from pictures (lights, height, width) to what is predicted; 1 where that tells too little."""
    saturated = _SATURATED * float(light.max())
    before = directions[:, 2] > 0
    gains = np.ones(len(light))
    for index in np.flatnonzero(before):
        gains[index] = _gain(light[index], predicted[index], matte, saturated)
    return np.asarray(gains / np.median(gains[before])) if before.any() else gains


def _gain(light: Floats, predicted: Floats, matte: Mask, saturated: float) -> float:
    """The median factor from a picture (height, width) to what is predicted, where light falls; 1 if hardly any."""
    seen, expected = light[matte > 0.5], predicted[matte > 0.5]
    lit = (expected > _LIT * np.percentile(expected, 98)) & (seen > _LEAST_SEEN * expected) & (seen < saturated)
    return float(np.exp(np.median(np.log(expected[lit] / seen[lit])))) if lit.sum() >= _LEAST_LIT else 1.0


def _resized(picture: Floats, scale: float) -> Floats:
    """A picture (height, width[, channels]) so many times as large; the same one for 1."""
    if scale == 1:
        return picture
    size = (round(picture.shape[1] * scale), round(picture.shape[0] * scale))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)
