"""Pictures under one light each, made to fit one another: small rigid motions and strobes of varying strength undone.

Motion by what pictures under similar light predict of each other; strength, and which pictures are corrupt, by a model
of shading fitted to all.

Imported pictures made to fit one another, where they then fit better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import LightsError
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.base.images.resize import shrink
from relit_camera.capture.alignment.outlier_pictures import find_outlier_pictures, masked_correlation, predict_pictures
from relit_camera.capture.alignment.rigid_transform import (
    RigidTransform,
    transforms_from_array,
    transforms_to_array,
    warp_to_reference,
)
from relit_camera.capture.alignment.template_alignment import (
    Template,
    align_across_lights,
    visible_detail,
    without_border,
)
from relit_camera.capture.reflectance.samples import Samples

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
MIN_PICTURES = 8
"""Fewer pictures cannot tell motion from shading."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """How the pictures of a set lie to each other.

    Attributes:
        transforms: for each picture, to where the face is on average; none for those rejected.
        gains: (lights,) factors that make up for strobes of varying strength; the median of those in front is 1. Light
            from behind keeps its strength.
        correlation: (lights,) correlation with what is predicted for the light, -1 to 1; 0 for those rejected.
        rejected: index and reason of pictures that no light could make.
    """

    transforms: tuple[RigidTransform, ...]
    gains: NDArray[np.float64]
    correlation: NDArray[np.float64]
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
        if len(self.kept) < MIN_PICTURES:
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
    small, inside, scale = downscale_for_alignment(pictures, matte)
    light, count = luminance(small), len(pictures)
    rejected = find_outlier_pictures(light, predict_pictures(small, directions, inside), directions, inside)
    kept = np.setdiff1d(np.arange(count), list(rejected))
    transforms, gains, correlation = [RigidTransform()] * count, np.ones(count), np.zeros(count)
    if len(kept) >= MIN_PICTURES:
        found = align_across_lights(light[kept], inside, rounds=_ROUNDS, progress=progress)
        for index, each in zip(kept, _without_drift(found, directions[kept]), strict=True):
            transforms[index] = each
        moved = np.stack([apply_alignment(small[index], transforms[index]) for index in kept])
        predicted = predict_pictures(moved, directions[kept], inside)
        gains[kept] = _gains(luminance(moved), predicted, directions[kept], inside)
        correlation[kept] = masked_correlation(luminance(moved), predicted, inside)
    return Alignment(tuple(each.scaled(1 / scale) for each in transforms), gains, correlation, rejected)


def downscale_for_alignment(pictures: Floats, matte: Mask) -> tuple[Floats, Mask, float]:
    """Pictures (lights, height, width, 3) and matte as small as they are compared, and by what factor, 1 at most."""
    scale = min(1.0, _LARGEST_SIDE / max(matte.shape))
    return np.stack([shrink(picture, scale) for picture in pictures]), shrink(matte, scale), scale


def align_to_prediction(picture: LinearImage, predicted: LinearImage, matte: Mask) -> tuple[RigidTransform, float]:
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
    here, there = luminance(shrink(picture, scale)), luminance(shrink(predicted, scale))
    inside = shrink(matte, scale)
    here *= np.float32((there * inside).sum() / max(float((here * inside).sum()), 1e-9))
    shade = _SHADE * float(there.mean()) + 1e-9
    template = Template(visible_detail(there, shade), without_border(inside), same_light=False)
    transform = template.align(visible_detail(here, shade), RigidTransform()).scaled(1 / scale)
    if np.hypot(transform.x, transform.y) > _FARTHEST * max(matte.shape):
        transform = RigidTransform()
    return transform, _gain(luminance(apply_alignment(picture, transform)), luminance(predicted), matte, np.inf)


def apply_alignment(picture: Floats, transform: RigidTransform, gain: float = 1.0) -> Floats:
    """A picture (height, width[, channels]) moved and multiplied; never negative."""
    moved = picture if transform == RigidTransform() else warp_to_reference(picture, transform)
    return np.maximum(moved, 0) * np.float32(gain)


def _without_drift(transforms: list[RigidTransform], directions: NDArray[np.float64]) -> list[RigidTransform]:
    """Motion less the part that is linear in the light's direction.

    Under light from one side features seem to lie to that side: their shading moves, they do not. Where nothing moves
    that is most of what is measured; what really moves has little reason to go with the light.
    """
    rows = transforms_to_array(transforms)
    terms = np.column_stack([np.ones(len(rows)), directions])
    return transforms_from_array(rows - terms @ np.linalg.lstsq(terms, rows)[0])


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


_LEAST_SIDE = 32
"""In smaller pictures motion cannot be told."""
_BETTER = 0.05
"""Share of the misfit that alignment must take away: it takes 8 to 75 % from photographed sets, 2 % at most from
rendered ones that lie exactly, where it takes shading for motion."""
_JUDGED = 0.25
"""Z of the lights by which that is judged: shading within 75° of the camera is foretold well."""


@dataclass(frozen=True, eq=False)
class AlignmentResult:
    """What became of a set.

    Attributes:
        samples: to build from.
        told: what was done and which pictures were left out, a line each, for people.
    """

    samples: Samples
    told: Sequence[str]


def align_if_better(
    samples: Samples,
    names: Sequence[str],
    wanted: bool | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> AlignmentResult:
    """Samples without corrupt pictures, aligned where that makes them fit a model of their shading better.

    Args:
        samples: as read.
        names: of the pictures (lights).
        wanted: True aligns in any case, False leaves all as it is, None decides. Sets of fewer than eight lights, or of
            less than 32 pixels a side, are then left alone.
        progress: called with rounds of alignment done and their total.

    Raises:
        LightsError: they shall be aligned in any case, and are too few, or too few fit together.
    """
    if wanted is False:
        return AlignmentResult(samples, ["pictures left as they are"])
    count = len(names)
    if wanted and count < MIN_PICTURES:
        raise LightsError(
            f"{count} pictures are too few to align", f"give {MIN_PICTURES} at least, or leave them as is"
        )
    if not wanted and (count < MIN_PICTURES or min(samples.matte.shape) < _LEAST_SIDE):
        return AlignmentResult(samples, ["pictures left as they are: too few or too small to align"])
    found = align_samples(samples.pictures, samples.directions, samples.matte, progress)
    left_out = [f"left out: {names[index]}: {reason}" for index, reason in found.rejected.items()]
    if not wanted and len(found.kept) < MIN_PICTURES:
        unfit = [f"does not fit: {names[index]}: {reason}" for index, reason in found.rejected.items()]
        return AlignmentResult(samples, ["pictures left as they are: too few fit together to align", *unfit])
    if wanted or _is_better(found, samples):
        done = f"{len(found.kept)} of {count} pictures aligned"
        return AlignmentResult(found.samples(samples), [f"{done}: {_described(found, samples.directions)}", *left_out])
    done = "pictures left as they are, they lie well"
    if found.rejected:
        samples = Samples(samples.pictures[found.kept], samples.directions[found.kept], samples.matte)
    return AlignmentResult(samples, [done, *left_out])


def _is_better(found: Alignment, samples: Samples) -> bool:
    """Whether the pictures kept fit a model of shading clearly better once they are aligned."""
    small, matte, scale = downscale_for_alignment(samples.pictures, samples.matte)
    aligned = replace(found, transforms=tuple(each.scaled(scale) for each in found.transforms)).pictures(small)
    before, after = (_misfit(each[found.kept], samples.directions[found.kept], matte) for each in (small, aligned))
    return after < (1 - _BETTER) * before


def _misfit(pictures: NDArray[np.float32], directions: NDArray[np.float64], matte: NDArray[np.float32]) -> float:
    """RMS of what a model of shading fitted to all pictures (lights, height, width, 3) leaves, as a share of theirs."""
    judged, inside = directions[:, 2] > _JUDGED, matte > 0.5
    light = luminance(pictures)
    left = (light - predict_pictures(pictures, directions, matte))[judged][:, inside]
    return float(np.linalg.norm(left)) / max(float(np.linalg.norm(light[judged][:, inside])), 1e-9)


def _described(found: Alignment, directions: NDArray[np.float64]) -> str:
    """How far the pictures kept went, in pixels, and how far the strobes' strength spreads, before the person."""
    motion = np.linalg.norm(transforms_to_array(found.transforms)[found.kept, 1:], axis=1)
    spread = np.std(np.log(found.gains[found.kept][directions[found.kept, 2] > 0]))
    return f"motion {np.sqrt(np.mean(motion**2)):.2f} px RMS, strobes' strength spread by {spread:.1%}"
