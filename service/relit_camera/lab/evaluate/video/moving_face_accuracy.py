"""How near a relit moving person comes to the truth, part by part: face, mouth, eyes, hair, neck, rim."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.lab.evaluate.video.person_regions import Region

PARTS = ("person", "face", "hair", "neck", "body", "rim", "mouth", "eyes", "far cheek")
"""The parts of `person_regions`, in the order of tables."""
MAX_DB = 60.0
"""PSNR of two pictures that are equal, so that means exist."""


@dataclass(frozen=True)
class PartFigures:
    """PSNR of one video's parts against the truth's, of sRGB codes with the peak 255, one gain of light a frame.

    Attributes:
        decibels: of each frame in which it applies, by part.
    """

    decibels: Mapping[str, Sequence[float]]

    def mean(self, part: str) -> float:
        """Mean over the frames in which the part applies; NaN where there are none."""
        values = self.decibels.get(part, ())
        return float(np.mean(values)) if len(values) else float("nan")


@dataclass
class PartAccuracy:
    """Collects the figures of a video, frame by frame."""

    _decibels: dict[str, list[float]] = field(default_factory=dict)

    def add(self, shown: DisplayImage, truth: DisplayImage, parts: Mapping[str, Region]) -> DisplayImage:
        """Compare a frame (height, width, 3) with the truth; returns it with the gain that brings it nearest."""
        fitted = with_best_gain(shown, truth, parts["person"])
        for name, part in parts.items():
            self._decibels.setdefault(name, []).append(codes_psnr(fitted, truth, part))
        return fitted

    def figures(self) -> PartFigures:
        """What came of all frames."""
        return PartFigures(self._decibels)


def with_best_gain(shown: DisplayImage, truth: DisplayImage, person: Region) -> DisplayImage:
    """A picture with the one gain of light that brings its person nearest to the truth's, in least squares."""
    light, goal = linear_from_display(shown), linear_from_display(truth)[person]
    seen = light[person]
    gain = float((seen * goal).sum(dtype=np.float64)) / max(float((seen * seen).sum(dtype=np.float64)), 1e-12)
    return display_from_linear(light * np.float32(gain))


def codes_psnr(shown: DisplayImage, truth: DisplayImage, part: Region) -> float:
    """PSNR in dB of a picture's sRGB codes inside a part, 255 the peak; at most `MAX_DB`."""
    error = float(np.mean((shown[part].astype(np.float64) - truth[part]) ** 2)) / 255**2
    return min(-10 * float(np.log10(max(error, 1e-12))), MAX_DB)


def figures_table(rows: Iterable[tuple[str, PartFigures]]) -> str:
    """The mean figures as lines of text, a row each."""
    lines = ["".join([" " * 32, *(f"{part:>10}" for part in PARTS)])]
    lines += ["".join([f"{name:32}", *(f"{figures.mean(part):10.2f}" for part in PARTS)]) for name, figures in rows]
    return "\n".join(lines)
