"""A capture's errors as a report for people, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from relit_camera.evaluate.capture import CaptureErrors
from relit_camera.evaluate.charts import line_chart
from relit_camera.evaluate.page import chart, page, paragraph, table


def capture_json(errors: CaptureErrors) -> dict[str, object]:
    """The figures; null for what the report does not tell."""
    return {
        "frames": errors.frames,
        "bright_frames": errors.true_bright,
        "used_share": errors.used_share,
        "wrongly_bright": errors.wrongly_bright,
        "direction_deg": _spread(errors.direction_deg),
        "at_ball_deg": _spread(errors.at_ball_deg),
        "distance": _spread(np.abs(errors.distance_ratio - 1)),
        "rotation_deg": _spread(np.abs(errors.rotation_deg)),
        "translation_px": _spread(np.linalg.norm(errors.translation_px, axis=1)),
        "ball_px": dict(zip(("x", "y", "radius"), errors.ball_px, strict=True)) if errors.ball_px else None,
        "focal_ratio": errors.focal_ratio,
    }


def capture_text(errors: CaptureErrors) -> str:
    """The figures as a few lines of text."""
    lines = [
        f"{errors.used} of {errors.true_bright} bright frames used, {errors.wrongly_bright} taken for bright wrongly",
        *(f"{name}: {_words(values, unit)}" for name, values, unit in _rows(errors)),
    ]
    if errors.ball_px:
        lines.append("ball: x {:+.2f}, y {:+.2f}, radius {:+.2f} px".format(*errors.ball_px))
    if errors.focal_ratio:
        lines.append(f"focal length: {errors.focal_ratio:.3f} of the true one")
    return "\n".join(lines)


def capture_page(errors: CaptureErrors, title: str) -> str:
    """The HTML document."""
    return page(title, _blocks(errors))


def _blocks(errors: CaptureErrors) -> Iterator[str]:
    yield paragraph(
        "A video of a person, a mirror ball and a blinking hand-held light was rendered, so that the truth of every "
        f"frame is known. Of {errors.true_bright} frames that the flash lit wholly, {errors.used} were used "
        f"({errors.used_share:.0%}); {errors.wrongly_bright} others were taken for bright wrongly."
    )
    rows = []
    for name, values, unit in _rows(errors):
        spread = _spread(values)
        figures = [spread[key] for key in ("mean", "rms", "p95", "max")] if spread else ["not told"] * 4
        rows.append([f"{name}, {unit}", *figures])
    yield table(
        ["error", "mean", "RMS", "95 % below", "largest"],
        rows,
        "Light: angle between the found and the true direction toward it. Head: what remains of its motion in the "
        "picture after the found transform, a constant taken out. Smaller is better everywhere.",
    )
    if np.isfinite(errors.direction_deg).any() or np.isfinite(errors.at_ball_deg).any():
        lines = {"from the head": errors.direction_deg, "from the ball": errors.at_ball_deg}
        yield chart(
            line_chart(errors.index, lines, "frame", "degrees"),
            "Error of the light's direction in each bright frame. A constant error points to the ball or the focal "
            "length, a slow wave to the parallax between ball and head, single peaks to frames lit in part.",
        )


def _rows(errors: CaptureErrors) -> list[tuple[str, NDArray[np.float64], str]]:
    return [
        ("light from the head", errors.direction_deg, "degrees"),
        ("light from the ball", errors.at_ball_deg, "degrees"),
        ("light's distance from the head", 100 * np.abs(errors.distance_ratio - 1), "%"),
        ("head rotation", np.abs(errors.rotation_deg), "degrees"),
        ("head translation", np.linalg.norm(errors.translation_px, axis=1), "px"),
    ]


def _spread(values: NDArray[np.float64]) -> dict[str, float] | None:
    known = values[np.isfinite(values)]
    if not known.size:
        return None
    return {
        "mean": float(known.mean()),
        "rms": float(np.sqrt((known**2).mean())),
        "p95": float(np.percentile(known, 95)),
        "max": float(known.max()),
    }


def _words(values: NDArray[np.float64], unit: str) -> str:
    spread = _spread(values)
    if spread is None:
        return "not told"
    return f"mean {spread['mean']:.2f}, 95 % below {spread['p95']:.2f}, at most {spread['max']:.2f} {unit}"
