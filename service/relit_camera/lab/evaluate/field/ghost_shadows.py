"""Ghost shadows (thesis 5.3): a shadow edge that interpolation shows twice, each at half strength.

Between a light that reaches a spot and one that does not, a mixture gives a mid-tone; in truth the spot is lit or in
shadow. So spots are looked at that are lit under one of the captured lights round a direction and dark under another,
and each picture's value is put on a scale from the darkest of those captures (0) to the brightest (1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance
from relit_camera.capture.reflectance.barycentric_methods import SphericalBarycentric
from relit_camera.capture.reflectance.samples import Samples
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth, pixel_colors

DARK_FRACTION = 0.15
"""Dark under one captured light: at most this share of what the brightest of them gives."""
BRIGHT_FRACTION = 0.5
"""Lit: at least this share of the bright parts of the picture. So bright a spot faces the light within about 60°; where
it is dark under a neighbouring light, that light does not graze it, but something stands before it."""
MID_TONE_RANGE = (0.15, 0.6)
"""Above it lie spots that the light truly reaches, though aslant."""
HISTOGRAM_EDGES = np.linspace(-0.25, 1.25, 31)
"""Bins of the histograms."""


@dataclass(frozen=True)
class ShadowTransition:
    """Spots that some of the captured lights round a direction reach and others do not.

    Attributes:
        light: index of the truth light.
        around: indices (up to 3,) of the captured lights round it, the nearest in weight first.
        decided: (pixels,) which pixels inside the matte are such spots.
        low, high: (decided pixels,) least and largest luminance under the lights around.
    """

    light: int
    around: tuple[int, ...]
    decided: NDArray[np.bool_]
    low: NDArray[np.float32]
    high: NDArray[np.float32]

    def scale(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Luminance (pixels,) of all pixels inside → its place from low 0 to high 1 at the decided ones."""
        return np.asarray((values[self.decided] - self.low) / (self.high - self.low))

    def mid_tones(self, values: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which pixels inside (pixels,) are such spots and show a mid-tone at luminance `values` (pixels,)."""
        shown = np.zeros(len(self.decided), bool)
        scale = self.scale(values)
        shown[self.decided] = (scale > MID_TONE_RANGE[0]) & (scale < MID_TONE_RANGE[1])
        return shown


def find_shadow_transitions(samples: Samples, truth: GroundTruth, lights: NDArray[np.intp]) -> list[ShadowTransition]:
    """For each truth light of these indices (inside the sampled region) the spots that lie between lit and dark."""
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
    """Shares (30,) of all spots that colours (truth lights, pixels, 3) put into each bin of the scale."""
    counts = np.zeros(len(HISTOGRAM_EDGES) - 1)
    for between in spots:
        scale = between.scale(luminance(colors[between.light]))
        counts += np.histogram(np.clip(scale, HISTOGRAM_EDGES[0], HISTOGRAM_EDGES[-1]), HISTOGRAM_EDGES)[0]
    return np.asarray(counts / max(counts.sum(), 1))


def mid_tone_share(spots: list[ShadowTransition], colors: NDArray[np.float32]) -> float:
    """Share of all spots at which colours (truth lights, pixels, 3) show a mid-tone; 0 if there are no spots."""
    total = sum(int(between.decided.sum()) for between in spots)
    mid = sum(int(between.mid_tones(luminance(colors[between.light])).sum()) for between in spots)
    return mid / max(total, 1)


def ghost_pixels(
    between: ShadowTransition, colors: NDArray[np.float32], truth: NDArray[np.float32]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Pixels inside (pixels,) that colours (pixels, 3) show as mid-tones: those truly dark, and those truly lit."""
    seen, known = between.mid_tones(luminance(colors)), between.scale(luminance(truth))
    dark, lit = np.zeros(len(seen), bool), np.zeros(len(seen), bool)
    dark[between.decided] = known <= MID_TONE_RANGE[0]
    lit[between.decided] = known >= MID_TONE_RANGE[1]
    return seen & dark, seen & lit


def clearest_ghosts(
    spots: list[ShadowTransition], colors: NDArray[np.float32], truth: NDArray[np.float32]
) -> ShadowTransition | None:
    """Where colours (truth lights, pixels, 3) show most ghosts, of dark and of lit spots; None if they show none."""
    counts = [min(int(part.sum()) for part in ghost_pixels(s, colors[s.light], truth[s.light])) for s in spots]
    return spots[int(np.argmax(counts))] if counts and max(counts) > 0 else None
