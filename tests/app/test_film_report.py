"""The report that a person acts on: verdicts, and frames that were dropped for the same reason together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relit_camera.app.captures.film.film_report import film_report
from tests.app.subject_builders import captured

METADATA = captured("film").metadata.model_copy(update={"expected_db": 33.0})


def told(covered: float = 0.5, used: int = 90, rejected: dict[str, int] | None = None, *warnings: str) -> Any:
    reasons = [reason for reason, count in (rejected or {}).items() for _ in range(count)]
    frames = [{"kind": "bright", "reason": ""}] * used + [{"kind": "dark", "reason": ""}] * 100
    frames += [{"kind": "partial", "reason": ""}] * 20
    frames += [{"kind": "rejected", "reason": reason} for reason in reasons]
    return {
        "frames": frames,
        "light": {"area_sr": 2 * np.pi * covered, "frames": used, "lights": 80},
        "warnings": list(warnings),
    }


def test_a_good_film() -> None:
    report = film_report(told(), METADATA, ["/a.jpg"])
    assert (report.verdict, report.directions, report.frames, report.used) == ("good", 80, 210, 90)
    assert report.because.startswith("light came from 50% of the space before the face")
    assert report.covered_fraction == pytest.approx(0.5)
    assert (report.expected_db, report.pictures) == (33.0, ("/a.jpg",))
    assert [(each.count, each.why[:11]) for each in report.dropped] == [(20, "the lamp wa")]


@pytest.mark.parametrize(
    ("film", "verdict", "because"),
    [
        (told(0.15), "again", "15% of the space before the face only: lead the lamp farther"),
        (
            told(0.5, 30, {"the ball is hidden": 70}),
            "again",
            "30% of the flashes' frames could be used; most often",
        ),
        (told(0.3), "usable", "next time lead the lamp farther"),
        (told(0.5, 60, {"the ball is hidden": 40}), "usable", "most often the ball is hidden"),
        (told(0.5, 90, {}, "the ball was pushed", "b"), "usable", "the ball was pushed"),
    ],
)
def test_what_is_not_good_says_why_and_what_to_do(film: Any, verdict: str, because: str) -> None:
    report = film_report(film, METADATA)
    assert report.verdict == verdict
    assert because in report.because
    assert report.warnings == tuple(film["warnings"])


def test_frames_of_one_fault_count_together() -> None:
    rejected = {
        "weak flash: 31% of the usual light": 3,
        "weak flash: 8% of the usual light": 2,
        "the brightest place has 7 pixels, in other frames 30": 1,
        "the brightest place has 9 pixels, in other frames 31": 1,
        "the ball is hidden": 1,
    }
    dropped = film_report(told(0.5, 90, rejected), METADATA).dropped
    assert [(each.count, each.why) for each in dropped[1:]] == [
        (5, "weak flash"),
        (2, "the brightest place has … pixels, in other frames …"),
        (1, "the ball is hidden"),
    ]


def test_where_the_lamp_was_in_each_frame_that_was_used() -> None:
    lit = told(used=2)
    lit["frames"][:2] = [lit["frames"][0] | {"direction": [x, 0.0, 0.80004]} for x in (0.6, -0.6)]
    assert film_report(lit, METADATA).lights == ((0.6, 0.0, 0.8), (-0.6, 0.0, 0.8))
