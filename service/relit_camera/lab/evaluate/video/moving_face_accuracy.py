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
        stillness: mean absolute change of a code from frame to frame inside the person; NaN for a single frame.
    """

    decibels: Mapping[str, Sequence[float]]
    stillness: float = float("nan")

    def mean(self, part: str) -> float:
        """Mean over the frames in which the part applies; NaN where there are none."""
        values = self.decibels.get(part, ())
        return float(np.mean(values)) if len(values) else float("nan")


@dataclass
class PartAccuracy:
    """Collects the figures of a video, frame by frame."""

    _decibels: dict[str, list[float]] = field(default_factory=dict)
    _changes: list[float] = field(default_factory=list)
    _last: DisplayImage | None = None

    def add(self, shown: DisplayImage, truth: DisplayImage, parts: Mapping[str, Region]) -> DisplayImage:
        """Compare a frame (height, width, 3) with the truth; returns it with the gain that brings it nearest."""
        person = parts["person"]
        fitted = with_best_gain(shown, truth, person)
        error = (fitted.astype(np.float32) - truth) ** 2
        for name, part in parts.items():
            worst = float(error[part].mean()) / 255**2
            self._decibels.setdefault(name, []).append(min(-10 * np.log10(max(worst, 1e-12)), MAX_DB))
        if self._last is not None:
            self._changes.append(float(np.abs(shown.astype(np.int16) - self._last)[person].mean()))
        self._last = shown
        return fitted

    def figures(self) -> PartFigures:
        """What came of all frames."""
        return PartFigures(self._decibels, float(np.mean(self._changes)) if self._changes else float("nan"))


def with_best_gain(shown: DisplayImage, truth: DisplayImage, person: Region) -> DisplayImage:
    """A picture with the one gain of light that brings its person nearest to the truth's, in least squares."""
    light, goal = linear_from_display(shown), linear_from_display(truth)[person]
    seen = light[person]
    gain = float((seen * goal).sum(dtype=np.float64)) / max(float((seen * seen).sum(dtype=np.float64)), 1e-12)
    return display_from_linear(light * np.float32(gain))


def figures_table(rows: Iterable[tuple[str, PartFigures]]) -> str:
    """The mean figures as lines of text, a row each."""
    lines = ["".join([" " * 32, *(f"{part:>10}" for part in PARTS)])]
    lines += ["".join([f"{name:32}", *(f"{figures.mean(part):10.2f}" for part in PARTS)]) for name, figures in rows]
    return "\n".join(lines)
