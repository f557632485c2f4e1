"""Imported pictures made to fit one another, where they then fit better."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.align import LEAST_KEPT, Alignment, align_samples, scaled_down
from relit_camera.capture.shading_model import predict_pictures
from relit_camera.capture.stabilise.rigid import rows_of
from relit_camera.errors import LightsError
from relit_camera.reflectance.samples import Samples
from relit_camera.space.colour import luminance

_LEAST_SIDE = 32
"""In smaller pictures motion cannot be told."""
_BETTER = 0.05
"""Share of the misfit that alignment must take away: it takes 8 to 75 % from photographed sets, 2 % at most from
rendered ones that lie exactly, where it takes shading for motion."""
_JUDGED = 0.25
"""Z of the lights by which that is judged: shading within 75° of the camera is foretold well."""


@dataclass(frozen=True, eq=False)
class Aligned:
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
) -> Aligned:
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
        return Aligned(samples, ["pictures left as they are"])
    count = len(names)
    if wanted and count < LEAST_KEPT:
        raise LightsError(f"{count} pictures are too few to align", f"give {LEAST_KEPT} at least, or leave them as is")
    if not wanted and (count < LEAST_KEPT or min(samples.matte.shape) < _LEAST_SIDE):
        return Aligned(samples, ["pictures left as they are: too few or too small to align"])
    found = align_samples(samples.pictures, samples.directions, samples.matte, progress)
    left_out = [f"left out: {names[index]}: {reason}" for index, reason in found.rejected.items()]
    if not wanted and len(found.kept) < LEAST_KEPT:
        unfit = [f"does not fit: {names[index]}: {reason}" for index, reason in found.rejected.items()]
        return Aligned(samples, ["pictures left as they are: too few fit together to align", *unfit])
    if wanted or _is_better(found, samples):
        done = f"{len(found.kept)} of {count} pictures aligned"
        return Aligned(found.samples(samples), [f"{done}: {_described(found, samples.directions)}", *left_out])
    done = "pictures left as they are, they lie well"
    if found.rejected:
        samples = Samples(samples.pictures[found.kept], samples.directions[found.kept], samples.matte)
    return Aligned(samples, [done, *left_out])


def _is_better(found: Alignment, samples: Samples) -> bool:
    """Whether the pictures kept fit a model of shading clearly better once they are aligned."""
    small, matte, scale = scaled_down(samples.pictures, samples.matte)
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
    motion = np.linalg.norm(rows_of(found.transforms)[found.kept, 1:], axis=1)
    spread = np.std(np.log(found.gains[found.kept][directions[found.kept, 2] > 0]))
    return f"motion {np.sqrt(np.mean(motion**2)):.2f} px RMS, strobes' strength spread by {spread:.1%}"
