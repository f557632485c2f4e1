"""What a person is told of a capture from a film: whether to keep the subject, and what to do better."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from relit_camera.live.status.film_status import DroppedFrames, FilmReport
from relit_camera.subject.subject import SubjectMetadata


@dataclass(frozen=True)
class VerdictTunables:
    """Below which a film is usable only, and below which it should be filmed again.

    Attributes:
        good_fraction, usable_fraction: share of the half sphere before the face from which light was filmed. The path
            of the guide (docs/capture.md) covers about half; a film that covers less than an eighth is refused.
        good_used, usable_used: share of the wholly lit frames that could be used.
    """

    good_fraction: float = 0.35
    usable_fraction: float = 0.2
    good_used: float = 0.75
    usable_used: float = 0.4


_TUNABLES = VerdictTunables()
_PARTLY_LIT = "the lamp was on for a part of the exposure only, as it is at the edges of each flash"


def film_report(
    told: Mapping[str, Any], metadata: SubjectMetadata, pictures: Sequence[str] = (), coda: str = ""
) -> FilmReport:
    """The report of a subject.

    Args:
        told: the capture's report, `capture.film.pipeline.capture_report.CaptureFindings.report`.
        metadata: of the subject.
        pictures: paths of pictures of the subject.
        coda: what the film's end gave.
    """
    frames, used = told["frames"], int(told["light"]["frames"])
    rejected = Counter(_kind_of_reason(frame["reason"]) for frame in frames if frame["kind"] == "rejected")
    partly = Counter({_PARTLY_LIT: sum(frame["kind"] == "partial" for frame in frames)})
    covered = min(float(told["light"]["area_sr"]) / (2 * np.pi), 1.0)
    verdict, because = _verdict(covered, used, rejected, told)
    return FilmReport(
        verdict=verdict,
        because=because,
        directions=int(told["light"]["lights"]),
        covered_fraction=covered,
        expected_db=metadata.expected_db,
        frames=len(frames),
        used=used,
        dropped=tuple(DroppedFrames(count, why) for why, count in (rejected + partly).most_common()),
        warnings=tuple(told["warnings"]),
        pictures=tuple(pictures),
        coda=coda,
        lights=tuple(_rounded(frame["direction"]) for frame in frames if frame.get("direction")),
    )


def _rounded(direction: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = (round(value, 3) for value in direction)
    return x, y, z


def _verdict(
    covered: float, used: int, rejected: Counter[str], told: Mapping[str, Any]
) -> tuple[Literal["good", "usable", "again"], str]:
    wider = "lead the lamp farther: from one ear to the other, from below the chin to above the head"
    if covered < _TUNABLES.usable_fraction:
        return "again", f"light came from {covered:.0%} of the space before the face only: {wider}"
    share = used / max(used + rejected.total(), 1)
    why = rejected.most_common(1)[0][0] if rejected else ""
    if share < _TUNABLES.usable_used:
        return "again", f"only {share:.0%} of the flashes' frames could be used; most often {why}"
    if covered < _TUNABLES.good_fraction:
        return "usable", f"light came from {covered:.0%} of the space before the face; next time {wider}"
    if share < _TUNABLES.good_used:
        return "usable", f"{share:.0%} of the flashes' frames could be used; most often {why}"
    if told["warnings"]:
        return "usable", str(told["warnings"][0])
    return "good", f"light came from {covered:.0%} of the space before the face, and {share:.0%} of its frames are good"


def _kind_of_reason(reason: str) -> str:
    """A reason without its figures, so that frames of the same fault count together."""
    return re.sub(r"\d[\d.]*", "…", reason.partition(":")[0])
