"""What a capture found in a video against the truth of a rendered one: frames, ball, light directions, head motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relit_camera.errors import InputError
from relit_camera.evaluate.json_file import Record, read_json

Vector = tuple[float, float, float]
Kind = Literal["bright", "dark", "partial", "rejected"]


class _Ball(Record):
    x: float
    y: float
    radius: Annotated[float, Field(gt=0)]


class _ReportFrame(Record):
    index: int
    kind: Kind
    direction: Vector | None = None
    at_ball: Vector | None = None
    distance_cm: Annotated[float, Field(gt=0)] | None = None
    rotation_deg: float | None = None
    translation_px: tuple[float, float] | None = None


class _Report(Record):
    ball: _Ball | None = None
    focal_px: float | None = None
    frames: Annotated[list[_ReportFrame], Field(min_length=1)]


class _TrueBall(Record):
    x_px: float
    y_px: float
    radius_px: float


class _Light(Record):
    direction: Vector
    at_ball: Vector
    at_second_ball: Vector | None = None
    distance_cm: Annotated[float, Field(gt=0)]


class _Flash(Record):
    state: Literal["bright", "dark", "partial"]


class _ToRest(Record):
    rotation_deg: float
    translation_px: tuple[float, float]


class _Head(Record):
    to_rest: _ToRest


class _TrueFrame(Record):
    index: int
    light: _Light
    flash: _Flash
    head: _Head


class _Truth(Record):
    ball: _TrueBall
    second_ball: _TrueBall | None = None
    focal_px: float
    frames: Annotated[list[_TrueFrame], Field(min_length=1)]


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
    ball_px: Vector | None
    focal_ratio: float | None

    @property
    def used_share(self) -> float:
        """Share of the wholly lit frames that were used."""
        return self.used / max(self.true_bright, 1)


def compare_capture(report: Path, truth: Path) -> CaptureErrors:
    """Compare a report of `relit capture` with the truth.json of a rendered capture.

    Raises:
        InputError: one is missing or in another form, or the report tells of frames that the video has not.
    """
    found = read_json(report, _Report, "give a report of `relit capture`")
    known = read_json(truth, _Truth, "give the truth.json of a rendered capture")
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
        direction_deg=np.array([_angle(f.direction, t.light.direction) for f, t in lit]),
        at_ball_deg=np.array(
            [_angle(f.at_ball, (second and t.light.at_second_ball) or t.light.at_ball) for f, t in lit]
        ),
        distance_ratio=np.array([(f.distance_cm or np.nan) / t.light.distance_cm for f, t in lit]),
        rotation_deg=_centred(np.array(rotation)),
        translation_px=_centred(np.array(shift).reshape(-1, 2)),
        ball_px=(ball.x - true_ball.x_px, ball.y - true_ball.y_px, ball.radius - true_ball.radius_px) if ball else None,
        focal_ratio=found.focal_px / known.focal_px if found.focal_px else None,
    )


def _is_second(found: _Report, known: _Truth) -> bool:
    """Whether the report's ball is the truth's second one."""
    if found.ball is None or known.second_ball is None:
        return False
    first, second = (
        np.hypot(found.ball.x - each.x_px, found.ball.y - each.y_px) for each in (known.ball, known.second_ball)
    )
    return bool(second < first)


def _angle(found: Vector | None, known: Vector) -> float:
    """Degrees between two directions; NaN for none."""
    if found is None:
        return float("nan")
    a, b = np.array(found), np.array(known)
    # Exact for small angles too, where the arc cosine is not.
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _centred(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values - values.mean(axis=0) if len(values) else values
