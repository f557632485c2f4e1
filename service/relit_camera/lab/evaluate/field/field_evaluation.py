"""Evaluation of a reflectance field on a subject with known truth (thesis 7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import LightsError
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.field.candidates import BASELINE_METHOD, Candidate
from relit_camera.lab.evaluate.field.ghost_shadows import (
    ShadowTransition,
    clearest_ghosts,
    find_shadow_transitions,
    histogram,
    mid_tone_fraction,
)
from relit_camera.lab.evaluate.field.ground_truth import GroundTruth, not_captured, sampled_region
from relit_camera.lab.evaluate.field.relighting_metrics import (
    RelitComparison,
    compare_relit,
    compare_under_environments,
    pixel_errors,
    psnr_per_light,
    squared_distances,
)
from relit_camera.lab.evaluate.field.sample_points import SamplePoint
from relit_camera.light import spherical_harmonics
from relit_camera.light.directions import texel_directions
from relit_camera.light.light_map import LightMap

HARMONIC_DEGREES = (2, 3, 8)
"""Degrees of the spherical harmonics that environments are projected onto; learned relighting uses 2."""
PROFILE_BINS = 24


@dataclass(frozen=True)
class CandidateScores:
    """Scores of one candidate. Errors are the thesis's measure of linear colors.

    Attributes:
        name: the candidate's.
        error_whole, error_region: (pixels,) over all lights, and over those inside the sampled region.
        error_of_light: (truth lights,) mean squared distance over the pixels.
        light_psnr_db: mean over single lights inside the region that were not captured.
        mid_tone_fraction: fraction of the pixels between lit and dark that are mid-tones (see `ghost_shadows`).
        histogram: (30,) fractions of these pixels on the scale from dark to lit.
        relit: by environment.
        maps: (spots, 2048, 3) reflectance maps at the spots, on the 64 × 32 map.
        ghost: (pixels, 3) colors under the light of the ghost example; empty if there is none.
    """

    name: str
    error_whole: NDArray[np.float64]
    error_region: NDArray[np.float64]
    error_of_light: NDArray[np.float64]
    light_psnr_db: float
    mid_tone_fraction: float
    histogram: NDArray[np.float64]
    relit: Mapping[str, RelitComparison]
    maps: NDArray[np.float32]
    ghost: NDArray[np.float32]

    @property
    def psnr_db(self) -> float:
        """Mean PSNR over the environments."""
        return float(np.mean([each.psnr_db for each in self.relit.values()]))

    @property
    def ssim(self) -> float:
        """Mean SSIM over the environments."""
        return float(np.mean([each.ssim for each in self.relit.values()]))


@dataclass(frozen=True)
class FieldReport:
    """Result of a field's evaluation.

    Attributes:
        truth: the true pictures.
        captured: (lights, 3) directions that the field was built from.
        in_region: (truth lights,) which lie inside the sampled region.
        candidate_scores: the candidates, best first by the error inside the region.
        spots: sample points whose reflectance maps are kept.
        environments: by name.
        truth_mid_tones, truth_histogram: as `CandidateScores` has them, of the truth itself.
        ghost: the light under which ghosts are most visible, or None.
        harmonics: environment → degree → the truth under the light put through harmonics, against the light itself.
    """

    truth: GroundTruth
    captured: NDArray[np.float64]
    in_region: NDArray[np.bool_]
    candidate_scores: Sequence[CandidateScores]
    spots: Sequence[SamplePoint]
    environments: Mapping[str, LightMap]
    truth_mid_tones: float
    truth_histogram: NDArray[np.float64]
    ghost: ShadowTransition | None
    harmonics: Mapping[str, Mapping[int, RelitComparison]]

    def across(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean (24,) of values (pixels,) by position across the person, from the left edge of each row to the right."""
        places = (self.positions + 1) / 2 * PROFILE_BINS
        bins = np.clip(places.astype(int), 0, PROFILE_BINS - 1)
        counts = np.bincount(bins, minlength=PROFILE_BINS)
        return np.asarray(np.bincount(bins, values, PROFILE_BINS) / np.maximum(counts, 1))

    def sides_over_middle(self, values: NDArray[np.float64]) -> float:
        """Ratio of the mean value (pixels,) in the outer sixths to that in the middle third."""
        place = np.abs(self.positions)
        return float(values[place > 2 / 3].mean() / max(values[place < 1 / 3].mean(), 1e-30))

    @property
    def positions(self) -> NDArray[np.float64]:
        """Position (pixels,) of each pixel across the person: −1 at the left edge of its row, 1 at the right."""
        width = self.truth.samples.matte.shape[1]
        row, column = np.divmod(self.truth.inside, width)
        first = np.full(row.max() + 1, width)
        last = np.zeros(row.max() + 1, int)
        np.minimum.at(first, row, column)
        np.maximum.at(last, row, column)
        return np.asarray(2 * (column - first[row]) / np.maximum(last - first, 1)[row] - 1)


def evaluate_field(
    candidates: Sequence[Candidate],
    captured: NDArray[np.float64],
    captured_samples: OlatSamples | None,
    truth: GroundTruth,
    environments: Mapping[str, LightMap],
    spots: Sequence[SamplePoint],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> FieldReport:
    """Compare candidates with the truth.

    Args:
        candidates: predictors to compare.
        captured: (lights, 3) the directions that they were built from.
        captured_samples: pictures under these lights, to find ghost shadows between them; None if there is a subject
            only.
        truth: the true pictures.
        environments: light maps by name.
        spots: sample points whose reflectance maps are kept.
        progress: called with candidates done and their total.

    Raises:
        LightsError: the truth has no light inside the sampled region that was not captured.
    """
    in_region = sampled_region(captured, truth.directions)
    judged_lights = np.flatnonzero(in_region & not_captured(captured, truth.directions))
    if not len(judged_lights):
        raise LightsError(
            "every truth light inside the sampled region was captured: nothing is left to compare with",
            "hold some back with --every or --within-deg, or give a denser truth",
        )
    places = pixel_positions(spots, truth)
    spots_lit_or_dark = find_shadow_transitions(captured_samples, truth, judged_lights) if captured_samples else []
    example: ShadowTransition | None = None
    candidate_scores = []
    # The baseline method comes first, since it chooses the light of the ghost example.
    ordered = sorted(candidates, key=lambda candidate: candidate.name != BASELINE_METHOD)
    for done, candidate in enumerate(ordered):
        colors = candidate.pictures_at(truth.directions)
        if done == 0:
            example = clearest_ghosts(spots_lit_or_dark, colors, truth.colors)
        distances = squared_distances(colors, truth.colors)
        candidate_scores.append(
            CandidateScores(
                name=candidate.name,
                error_whole=pixel_errors(distances, truth.weights),
                error_region=pixel_errors(distances, truth.weights, in_region),
                error_of_light=distances.mean(axis=1),
                light_psnr_db=float(psnr_per_light(colors, truth.colors, judged_lights).mean()),
                mid_tone_fraction=mid_tone_fraction(spots_lit_or_dark, colors),
                histogram=histogram(spots_lit_or_dark, colors),
                relit=compare_under_environments(colors, truth, environments),
                maps=candidate.maps_at(texel_directions().reshape(-1, 3), places),
                ghost=colors[example.light] if example else np.zeros((0, 3), np.float32),
            )
        )
        progress(done + 1, len(candidates))
    return FieldReport(
        truth=truth,
        captured=captured,
        in_region=in_region,
        candidate_scores=sorted(candidate_scores, key=lambda each: float(each.error_region.mean())),
        spots=spots,
        environments=environments,
        truth_mid_tones=mid_tone_fraction(spots_lit_or_dark, truth.colors),
        truth_histogram=histogram(spots_lit_or_dark, truth.colors),
        ghost=example,
        harmonics={name: relight_through_harmonics(truth, light_map) for name, light_map in environments.items()},
    )


def relight_through_harmonics(truth: GroundTruth, light_map: LightMap) -> dict[int, RelitComparison]:
    """The truth lit by a light map's harmonics of each of `HARMONIC_DEGREES`, against the map itself (Fig. 7.6)."""

    def lit(light: LightMap) -> NDArray[np.float32]:
        return np.asarray(np.einsum("lpc,lc->pc", truth.colors, truth.irradiance(light), optimize=True), np.float32)

    expected = lit(light_map)
    return {
        degree: compare_relit(
            truth, lit(spherical_harmonics.reconstruct(spherical_harmonics.project(light_map, degree))), expected
        )
        for degree in HARMONIC_DEGREES
    }


def pixel_positions(spots: Sequence[SamplePoint], truth: GroundTruth) -> NDArray[np.intp]:
    """Index (spots,) of each sample point among the truth's pixels inside the matte."""
    width = truth.samples.matte.shape[1]
    return np.searchsorted(truth.inside, [spot.y * width + spot.x for spot in spots])
