"""Aligning a set of one-light pictures: small rigid motions and strobes of varying strength are undone.

Motion is estimated from what pictures under similar light predict of each other; strength, and which pictures are
corrupt, from an appearance model fitted to all. `align_if_better` does so only where the pictures then fit the model
better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
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
from relit_camera.capture.reflectance.olat_samples import OlatSamples

MIN_PICTURES = 8
"""Fewer pictures cannot tell motion from shading."""


@dataclass(frozen=True)
class AlignmentTunables:
    """Constants of the alignment, chosen by `relit evaluate olat`.

    docs/reflectance.md has the figures that decide on `min_improvement`.

    Attributes:
        largest_side_px: larger pictures are shrunk to this.
        rounds: of `align_across_lights`.
        shade: summand under the root of light, as a fraction of the mean light: below it differences count no more.
        lit_fraction: a gain is estimated from pixels brighter than this fraction of the prediction's bright ones,
        saturated_fraction: darker than this fraction of the set's brightest pixel;
        min_observed_fraction: and brighter than this fraction of what is predicted for them, else they are in shadow.
        min_lit_pixels: fewer such pixels give no gain.
        max_shift_fraction: largest shift as a fraction of the longer side; someone who keeps still moves less.
        min_side_px: in smaller pictures motion cannot be measured.
        min_improvement: fraction of the misfit that alignment must remove. It removes 8 to 75 % from photographed sets
            and 2 % at most from rendered ones, which need none: there it takes shading for motion.
        judged_min_z: z of the lights by which that is judged: shading within 75° of the camera is predicted well.
    """

    largest_side_px: int = 256
    rounds: int = 3
    shade: float = 0.02
    lit_fraction: float = 0.3
    saturated_fraction: float = 0.97
    min_observed_fraction: float = 0.1
    min_lit_pixels: int = 100
    max_shift_fraction: float = 0.04
    min_side_px: int = 32
    min_improvement: float = 0.05
    judged_min_z: float = 0.25


TUNABLES = AlignmentTunables()


@dataclass(frozen=True, eq=False)
class Alignment:
    """Transforms and gains that align the pictures of a set, and which pictures are rejected.

    Attributes:
        transforms: for each picture, to the face's mean position; the identity for those rejected.
        gains: (lights,) factors that compensate strobes of varying strength; their median over lights in front is 1.
            Lights from behind have 1.
        correlation: (lights,) with the picture predicted for the light, -1 to 1; 0 for those rejected.
        rejected: index and reason of outlier pictures.
    """

    transforms: tuple[RigidTransform, ...]
    gains: NDArray[np.float64]
    correlation: NDArray[np.float64]
    rejected: Mapping[int, str]

    @property
    def kept(self) -> NDArray[np.intp]:
        """Indices of the pictures that are not rejected, ascending."""
        return np.setdiff1d(np.arange(len(self.gains)), list(self.rejected))

    def pictures(self, pictures: Float32Array) -> Float32Array:
        """All pictures (lights, height, width, channels), each transformed and multiplied by its gain."""
        moved = zip(pictures, self.transforms, self.gains.tolist(), strict=True)
        return np.stack([apply_alignment(*each) for each in moved])

    def samples(self, samples: OlatSamples) -> OlatSamples:
        """The samples that this alignment was estimated from, aligned, without the rejected ones.

        Raises:
            LightsError: fewer than eight are left.
        """
        if len(self.kept) < MIN_PICTURES:
            what = f"only {len(self.kept)} of {len(self.gains)} pictures fit together"
            raise LightsError(what, "give pictures of one thing that keeps still, and the directions of their lights")
        return OlatSamples(self.pictures(samples.pictures)[self.kept], samples.directions[self.kept], samples.matte)


def align_samples(
    pictures: Float32Array,
    directions: NDArray[np.float64],
    matte: Mask,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Alignment:
    """Estimate the alignment of pictures of one person under one light each.

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
        found = align_across_lights(light[kept], inside, rounds=TUNABLES.rounds, progress=progress)
        for index, each in zip(kept, _without_drift(found, directions[kept]), strict=True):
            transforms[index] = each
        moved = np.stack([apply_alignment(small[index], transforms[index]) for index in kept])
        predicted = predict_pictures(moved, directions[kept], inside)
        gains[kept] = _gains(luminance(moved), predicted, directions[kept], inside)
        correlation[kept] = masked_correlation(luminance(moved), predicted, inside)
    return Alignment(tuple(each.scaled(1 / scale) for each in transforms), gains, correlation, rejected)


def downscale_for_alignment(pictures: Float32Array, matte: Mask) -> tuple[Float32Array, Mask, float]:
    """Pictures (lights, height, width, 3) and matte, shrunk to the size of comparison, and the scale, 1 at most."""
    scale = min(1.0, TUNABLES.largest_side_px / max(matte.shape))
    return np.stack([shrink(picture, scale) for picture in pictures]), shrink(matte, scale), scale


def align_to_prediction(picture: LinearImage, predicted: LinearImage, matte: Mask) -> tuple[RigidTransform, float]:
    """The transform, and then the gain, that bring one picture nearest to a prediction of it.

    Args:
        picture: (height, width, 3) float32 linear.
        predicted: (height, width, 3) float32 linear, the prediction.
        matte: (height, width) where the person is.

    Returns:
        The transform, the identity where the shift would be implausibly large; and the gain after it: the median ratio
        over lit pixels. Least squares would take misplaced shadows for a weak strobe.
    """
    scale = min(1.0, TUNABLES.largest_side_px / max(matte.shape))
    here, there = luminance(shrink(picture, scale)), luminance(shrink(predicted, scale))
    inside = shrink(matte, scale)
    here *= np.float32((there * inside).sum() / max(float((here * inside).sum()), 1e-9))
    shade = TUNABLES.shade * float(there.mean()) + 1e-9
    template = Template(visible_detail(there, shade), without_border(inside), same_light=False)
    transform = template.align(visible_detail(here, shade), RigidTransform()).scaled(1 / scale)
    if np.hypot(transform.x, transform.y) > TUNABLES.max_shift_fraction * max(matte.shape):
        transform = RigidTransform()
    return transform, _gain(luminance(apply_alignment(picture, transform)), luminance(predicted), matte, np.inf)


def apply_alignment(picture: Float32Array, transform: RigidTransform, gain: float = 1.0) -> Float32Array:
    """A picture (height, width[, channels]) transformed and multiplied by its gain; never negative."""
    moved = picture if transform == RigidTransform() else warp_to_reference(picture, transform)
    return np.maximum(moved, 0) * np.float32(gain)


def _without_drift(transforms: list[RigidTransform], directions: NDArray[np.float64]) -> list[RigidTransform]:
    """Transforms without the part that is linear in the light's direction.

    Shading shifts features toward the light, though nothing moves. In a set that keeps still that is most of the
    measured motion; real motion is hardly correlated with the light's direction.
    """
    rows = transforms_to_array(transforms)
    terms = np.column_stack([np.ones(len(rows)), directions])
    return transforms_from_array(rows - terms @ np.linalg.lstsq(terms, rows)[0])


def _gains(
    light: Float32Array, predicted: Float32Array, directions: NDArray[np.float64], matte: Mask
) -> NDArray[np.float64]:
    """Gains (lights,) of pictures (lights, height, width) toward their predictions; 1 for lights from behind."""
    saturated = TUNABLES.saturated_fraction * float(light.max())
    in_front = directions[:, 2] > 0
    gains = np.ones(len(light))
    for index in np.flatnonzero(in_front):
        gains[index] = _gain(light[index], predicted[index], matte, saturated)
    return np.asarray(gains / np.median(gains[in_front])) if in_front.any() else gains


def _gain(light: Float32Array, predicted: Float32Array, matte: Mask, saturated: float) -> float:
    """The median ratio of prediction to picture (height, width) over lit pixels; 1 if too few are lit."""
    observed, expected = light[matte > 0.5], predicted[matte > 0.5]
    lit = (
        (expected > TUNABLES.lit_fraction * np.percentile(expected, 98))
        & (observed > TUNABLES.min_observed_fraction * expected)
        & (observed < saturated)
    )
    return (
        float(np.exp(np.median(np.log(expected[lit] / observed[lit])))) if lit.sum() >= TUNABLES.min_lit_pixels else 1.0
    )


@dataclass(frozen=True, eq=False)
class AlignmentResult:
    """What became of a set.

    Attributes:
        samples: to build from.
        messages: what was done and which pictures were left out, a line each, for people.
    """

    samples: OlatSamples
    messages: Sequence[str]


def align_if_better(
    samples: OlatSamples,
    names: Sequence[str],
    wanted: bool | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> AlignmentResult:
    """Samples without corrupt pictures, aligned where they then fit the appearance model better.

    Args:
        samples: as read.
        names: of the pictures (lights).
        wanted: True always aligns, False never, None decides by the misfit. Sets of fewer than eight lights, or of
            less than 32 pixels a side, are then left alone.
        progress: called with rounds of alignment done and their total.

    Raises:
        LightsError: `wanted` is True, and there are too few pictures, or too few fit together.
    """
    if wanted is False:
        return AlignmentResult(samples, ["pictures left as they are"])
    count = len(names)
    if wanted and count < MIN_PICTURES:
        raise LightsError(
            f"{count} pictures are too few to align", f"give {MIN_PICTURES} at least, or leave them as is"
        )
    if not wanted and (count < MIN_PICTURES or min(samples.matte.shape) < TUNABLES.min_side_px):
        return AlignmentResult(samples, ["pictures left as they are: too few or too small to align"])
    found = align_samples(samples.pictures, samples.directions, samples.matte, progress)
    left_out = [f"left out: {names[index]}: {reason}" for index, reason in found.rejected.items()]
    if not wanted and len(found.kept) < MIN_PICTURES:
        outliers = [f"does not fit: {names[index]}: {reason}" for index, reason in found.rejected.items()]
        return AlignmentResult(samples, ["pictures left as they are: too few fit together to align", *outliers])
    if wanted or _is_better(found, samples):
        done = f"{len(found.kept)} of {count} pictures aligned"
        return AlignmentResult(found.samples(samples), [f"{done}: {_described(found, samples.directions)}", *left_out])
    done = "pictures left as they are, they lie well"
    if found.rejected:
        samples = OlatSamples(samples.pictures[found.kept], samples.directions[found.kept], samples.matte)
    return AlignmentResult(samples, [done, *left_out])


def _is_better(found: Alignment, samples: OlatSamples) -> bool:
    """Whether the kept pictures fit the appearance model clearly better after alignment."""
    small, matte, scale = downscale_for_alignment(samples.pictures, samples.matte)
    aligned = replace(found, transforms=tuple(each.scaled(scale) for each in found.transforms)).pictures(small)
    before, after = (_misfit(each[found.kept], samples.directions[found.kept], matte) for each in (small, aligned))
    return after < (1 - TUNABLES.min_improvement) * before


def _misfit(pictures: NDArray[np.float32], directions: NDArray[np.float64], matte: NDArray[np.float32]) -> float:
    """RMS residual of the appearance model fitted to all pictures (lights, height, width, 3), relative to their RMS."""
    judged, inside = directions[:, 2] > TUNABLES.judged_min_z, matte > 0.5
    light = luminance(pictures)
    residual = (light - predict_pictures(pictures, directions, matte))[judged][:, inside]
    return float(np.linalg.norm(residual)) / max(float(np.linalg.norm(light[judged][:, inside])), 1e-9)


def _described(found: Alignment, directions: NDArray[np.float64]) -> str:
    """A text with the kept pictures' RMS motion in pixels and the spread of the front strobes' strength."""
    motion = np.linalg.norm(transforms_to_array(found.transforms)[found.kept, 1:], axis=1)
    spread = np.std(np.log(found.gains[found.kept][directions[found.kept, 2] > 0]))
    return f"motion {np.sqrt(np.mean(motion**2)):.2f} px RMS, strobes' strength spread by {spread:.1%}"
