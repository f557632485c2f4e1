"""Accuracy of a capture of a rendered video: frames, ball, light directions and head motion against the truth.

Reports are written as HTML, text and JSON.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relit_camera.base.errors import InputError
from relit_camera.lab.evaluate.json_records import Record, read_json_record
from relit_camera.lab.evaluate.rendered_truth import CaptureTruth, Vector3, read_truth
from relit_camera.lab.evaluate.report.html_page import Block, Paragraph, render_page, table
from relit_camera.lab.evaluate.report.plots import line_plot

FrameClassLabel = Literal["bright", "dark", "partial", "rejected"]


class _Ball(Record):
    x: float
    y: float
    radius: Annotated[float, Field(gt=0)]


class _ReportFrame(Record):
    index: int
    kind: FrameClassLabel
    direction: Vector3 | None = None
    at_ball: Vector3 | None = None
    distance_cm: Annotated[float, Field(gt=0)] | None = None
    rotation_deg: float | None = None
    translation_px: tuple[float, float] | None = None


class _Report(Record):
    ball: _Ball | None = None
    focal_px: float | None = None
    frames: Annotated[list[_ReportFrame], Field(min_length=1)]


@dataclass(frozen=True)
class CaptureErrors:
    """A capture's errors.

    Attributes:
        frames: how many the truth has.
        true_bright: how many of them the flash lit wholly.
        used: of those, how many the capture calls bright.
        wrongly_bright: frames that it calls bright and that were dark or lit in part.
        index: (bright,) of the frames whose errors follow: those that both call bright.
        direction_deg, at_ball_deg: (bright,) angle between the found and the true direction toward the light, from the
            head and from the ball; NaN where the report has none.
        distance_ratio: (bright,) found over true distance from the head to the light; NaN where the report has none.
        rotation_deg, translation_px: (moved,), (moved, 2) what remains of the head's motion after the found transform,
            over the bright and dark frames, its mean taken out: the reference frame need not be the truth's.
        ball_px: error of the ball's x, y and radius, of two that of the first; None where it has none.
        focal_ratio: found over true focal length; None where the report has none.
    """

    frames: int
    true_bright: int
    used: int
    wrongly_bright: int
    index: NDArray[np.intp]
    direction_deg: NDArray[np.float64]
    at_ball_deg: NDArray[np.float64]
    distance_ratio: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]
    translation_px: NDArray[np.float64]
    ball_px: Vector3 | None
    focal_ratio: float | None

    @property
    def used_fraction(self) -> float:
        """Fraction of the wholly lit frames that were used."""
        return self.used / max(self.true_bright, 1)


def compare_capture(report: Path, truth: Path) -> CaptureErrors:
    """Compare a report of `relit capture` with the truth.json of a rendered capture.

    Raises:
        InputError: one is missing or in another form, or the report tells of frames that the video has not.
    """
    found = read_json_record(report, _Report, "give a report of `relit capture`")
    known = read_truth(truth, CaptureTruth)
    by_index = {frame.index: frame for frame in known.frames}
    strangers = [frame.index for frame in found.frames if frame.index not in by_index]
    if strangers:
        raise InputError(
            f"{report} tells of frame {strangers[0]}, which {truth} has not", "both must be of the same video"
        )
    pairs = [(frame, by_index[frame.index]) for frame in found.frames]
    lit = [(f, t) for f, t in pairs if f.kind == "bright" and t.flash.state == "bright"]
    moved = [(f.rotation_deg, f.translation_px, t.head.to_rest) for f, t in pairs if f.kind in ("bright", "dark")]
    rotation = [r - t.rotation_deg for r, p, t in moved if r is not None and p is not None]
    shift = [np.subtract(p, t.translation_px) for r, p, t in moved if r is not None and p is not None]
    ball, second = found.ball, _is_second(found, known)
    true_ball = known.second_ball if second and known.second_ball else known.ball
    return CaptureErrors(
        frames=len(known.frames),
        true_bright=sum(frame.flash.state == "bright" for frame in known.frames),
        used=len(lit),
        wrongly_bright=sum(f.kind == "bright" and t.flash.state != "bright" for f, t in pairs),
        index=np.array([f.index for f, _ in lit], np.intp),
        direction_deg=np.array([_angle_between_deg(f.direction, t.light.direction) for f, t in lit]),
        at_ball_deg=np.array(
            [_angle_between_deg(f.at_ball, (second and t.light.at_second_ball) or t.light.at_ball) for f, t in lit]
        ),
        distance_ratio=np.array([(f.distance_cm or np.nan) / t.light.distance_cm for f, t in lit]),
        rotation_deg=_centered(np.array(rotation)),
        translation_px=_centered(np.array(shift).reshape(-1, 2)),
        ball_px=(ball.x - true_ball.x_px, ball.y - true_ball.y_px, ball.radius - true_ball.radius_px) if ball else None,
        focal_ratio=found.focal_px / known.focal_px if found.focal_px else None,
    )


def _is_second(found: _Report, known: CaptureTruth) -> bool:
    """Whether the report's ball is the truth's second one."""
    if found.ball is None or known.second_ball is None:
        return False
    first, second = (
        np.hypot(found.ball.x - each.x_px, found.ball.y - each.y_px) for each in (known.ball, known.second_ball)
    )
    return bool(second < first)


def _angle_between_deg(found: Vector3 | None, known: Vector3) -> float:
    """Degrees between two directions; NaN for none."""
    if found is None:
        return float("nan")
    a, b = np.array(found), np.array(known)
    # Exact for small angles too, where the arc cosine is not.
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _centered(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values - values.mean(axis=0) if len(values) else values


def capture_json(errors: CaptureErrors) -> dict[str, object]:
    """The figures; null for what the report does not tell."""
    return {
        "frames": errors.frames,
        "bright_frames": errors.true_bright,
        "used_share": errors.used_fraction,
        "wrongly_bright": errors.wrongly_bright,
        "direction_deg": _statistics(errors.direction_deg),
        "at_ball_deg": _statistics(errors.at_ball_deg),
        "distance": _statistics(np.abs(errors.distance_ratio - 1)),
        "rotation_deg": _statistics(np.abs(errors.rotation_deg)),
        "translation_px": _statistics(np.linalg.norm(errors.translation_px, axis=1)),
        "ball_px": dict(zip(("x", "y", "radius"), errors.ball_px, strict=True)) if errors.ball_px else None,
        "focal_ratio": errors.focal_ratio,
    }


def capture_text(errors: CaptureErrors) -> str:
    """The figures as a few lines of text."""
    lines = [
        f"{errors.used} of {errors.true_bright} bright frames used, {errors.wrongly_bright} taken for bright wrongly",
        *(f"{name}: {_format_statistics(values, unit)}" for name, values, unit in _error_rows(errors)),
    ]
    if errors.ball_px:
        lines.append("ball: x {:+.2f}, y {:+.2f}, radius {:+.2f} px".format(*errors.ball_px))
    if errors.focal_ratio:
        lines.append(f"focal length: {errors.focal_ratio:.3f} of the true one")
    return "\n".join(lines)


def capture_page(errors: CaptureErrors, title: str) -> str:
    """The HTML document."""
    return render_page(title, _capture_blocks(errors))


def _capture_blocks(errors: CaptureErrors) -> Iterator[Block]:
    yield Paragraph(
        "A video of a person, a mirror ball and a blinking hand-held light was rendered, so that the truth of every "
        f"frame is known. Of {errors.true_bright} frames that the flash lit completely, {errors.used} were used "
        f"({errors.used_fraction:.0%}); {errors.wrongly_bright} other frames were classified as bright by mistake."
    )
    rows = []
    for name, values, unit in _error_rows(errors):
        spread = _statistics(values)
        figures = [spread[key] for key in ("mean", "rms", "p95", "max")] if spread else ["not told"] * 4
        rows.append([f"{name}, {unit}", *figures])
    yield table(
        ["error", "mean", "RMS", "95 % below", "largest"],
        rows,
        "Light: angle between the found and the true direction toward it. Head: motion in the picture that remains "
        "after the found transform, without its mean. Smaller is better everywhere.",
    )
    if np.isfinite(errors.direction_deg).any() or np.isfinite(errors.at_ball_deg).any():
        lines = {"from the head": errors.direction_deg, "from the ball": errors.at_ball_deg}
        yield line_plot(
            errors.index,
            lines,
            "frame",
            "degrees",
            "Error of the light's direction in each bright frame. A constant error points to the ball or the focal "
            "length, a slow wave to the parallax between ball and head, single peaks to partly lit frames.",
            from_zero=True,
        )


def _error_rows(errors: CaptureErrors) -> list[tuple[str, NDArray[np.float64], str]]:
    return [
        ("light from the head", errors.direction_deg, "degrees"),
        ("light from the ball", errors.at_ball_deg, "degrees"),
        ("light's distance from the head", 100 * np.abs(errors.distance_ratio - 1), "%"),
        ("head rotation", np.abs(errors.rotation_deg), "degrees"),
        ("head translation", np.linalg.norm(errors.translation_px, axis=1), "px"),
    ]


def _statistics(values: NDArray[np.float64]) -> dict[str, float] | None:
    known = values[np.isfinite(values)]
    if not known.size:
        return None
    return {
        "mean": float(known.mean()),
        "rms": float(np.sqrt((known**2).mean())),
        "p95": float(np.percentile(known, 95)),
        "max": float(known.max()),
    }


def _format_statistics(values: NDArray[np.float64], unit: str) -> str:
    spread = _statistics(values)
    if spread is None:
        return "not told"
    return f"mean {spread['mean']:.2f}, 95 % below {spread['p95']:.2f}, at most {spread['max']:.2f} {unit}"
