"""Ghost shadows (thesis 5.3): shadow edges that interpolation shows twice, each at half strength.

Between a light that reaches a pixel and one that does not, interpolation gives a mid-tone; in truth the pixel is lit or
in shadow. The measure considers pixels that are lit under one of the captured lights around a direction and dark under
another. It puts predicted luminance on a scale from the darkest of these captures (0) to the brightest (1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth, pixel_colors

DARK_FRACTION = 0.15
"""A pixel is dark under a captured light at this fraction or less of its luminance under the brightest one."""
BRIGHT_FRACTION = 0.5
"""A pixel is lit at this fraction or more of the picture's bright parts. It then faces the light within about 60°, so
where it is dark under a neighboring light, it is occluded and not just grazed."""
MID_TONE_RANGE = (0.15, 0.6)
"""Positions on the scale that count as mid-tones. Higher ones occur in truth under slanted light."""
HISTOGRAM_EDGES = np.linspace(-0.25, 1.25, 31)
"""Bins of the histograms."""


@dataclass(frozen=True)
class ShadowTransition:
    """Pixels that some of the captured lights around a direction reach and others do not.

    Attributes:
        light: index of the truth light.
        around: indices (up to 3,) of the captured lights around it, by falling weight.
        decided: (pixels,) which pixels inside the matte are such pixels.
        low, high: (decided pixels,) least and largest luminance under the lights around it.
    """

    light: int
    around: tuple[int, ...]
    decided: NDArray[np.bool_]
    low: NDArray[np.float32]
    high: NDArray[np.float32]

    def scale(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Luminance (pixels,) of all pixels inside → position from low 0 to high 1 of the decided ones."""
        return np.asarray((values[self.decided] - self.low) / (self.high - self.low))

    def mid_tones(self, values: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which pixels inside (pixels,) are decided and show a mid-tone at luminance `values` (pixels,)."""
        shown = np.zeros(len(self.decided), bool)
        scale = self.scale(values)
        shown[self.decided] = (scale > MID_TONE_RANGE[0]) & (scale < MID_TONE_RANGE[1])
        return shown


def find_shadow_transitions(
    samples: OlatSamples, truth: GroundTruth, lights: NDArray[np.intp]
) -> list[ShadowTransition]:
    """Shadow transitions for the truth lights of these indices, which must lie inside the sampled region."""
    captured = luminance(pixel_colors(samples, truth.inside))
    weights = SphericalBarycentric().weights(samples.directions, truth.directions[lights])
    found = []
    for light, column in zip(lights.tolist(), weights.T, strict=True):
        around = np.flatnonzero(column)
        values = captured[around]
        low, high = values.min(axis=0), values.max(axis=0)
        bright = np.percentile(high, 99.5)
        decided = (low <= DARK_FRACTION * high) & (high >= BRIGHT_FRACTION * bright) & (high > 0)
        order = around[np.argsort(-column[around])]
        found.append(ShadowTransition(light, tuple(order.tolist()), decided, low[decided], high[decided]))
    return found


def histogram(spots: list[ShadowTransition], colors: NDArray[np.float32]) -> NDArray[np.float64]:
    """Histogram (30,), as fractions, of all decided pixels of colors (truth lights, pixels, 3) on the scale."""
    counts = np.zeros(len(HISTOGRAM_EDGES) - 1)
    for between in spots:
        scale = between.scale(luminance(colors[between.light]))
        counts += np.histogram(np.clip(scale, HISTOGRAM_EDGES[0], HISTOGRAM_EDGES[-1]), HISTOGRAM_EDGES)[0]
    return np.asarray(counts / max(counts.sum(), 1))


def mid_tone_fraction(spots: list[ShadowTransition], colors: NDArray[np.float32]) -> float:
    """Fraction of mid-tones among all decided pixels of colors (truth lights, pixels, 3); 0 if there are none."""
    total = sum(int(between.decided.sum()) for between in spots)
    mid = sum(int(between.mid_tones(luminance(colors[between.light])).sum()) for between in spots)
    return mid / max(total, 1)


def ghost_pixels(
    between: ShadowTransition, colors: NDArray[np.float32], truth: NDArray[np.float32]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Mid-tone pixels (pixels,) of colors (pixels, 3) that are dark in truth, and those that are lit in truth."""
    seen, known = between.mid_tones(luminance(colors)), between.scale(luminance(truth))
    dark, lit = np.zeros(len(seen), bool), np.zeros(len(seen), bool)
    dark[between.decided] = known <= MID_TONE_RANGE[0]
    lit[between.decided] = known >= MID_TONE_RANGE[1]
    return seen & dark, seen & lit


def clearest_ghosts(
    spots: list[ShadowTransition], colors: NDArray[np.float32], truth: NDArray[np.float32]
) -> ShadowTransition | None:
    """The transition where colors (truth lights, pixels, 3) show most ghosts of both kinds; None if there are none."""
    counts = [min(int(part.sum()) for part in ghost_pixels(s, colors[s.light], truth[s.light])) for s in spots]
    return spots[int(np.argmax(counts))] if counts and max(counts) > 0 else None
