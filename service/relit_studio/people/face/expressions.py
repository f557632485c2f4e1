"""Expressions by name, as weights of the face model's shapes."""

from __future__ import annotations

from collections.abc import Mapping

from relit_camera.base.errors import NotFoundError

Expression = Mapping[str, float]
"""Weights by the face model's names."""

NEUTRAL: Expression = {"mouthSmile_L": 0.3, "mouthSmile_R": 0.26, "eyeWide_L": 0.18, "eyeWide_R": 0.18}
"""The face at rest. The model's own zero looks tired."""
EXPRESSIONS: Mapping[str, Expression] = {
    "neutral": NEUTRAL,
    "smile": {
        "mouthSmile_L": 0.75, "mouthSmile_R": 0.75, "cheekSquint_L": 0.5, "cheekSquint_R": 0.5, "eyeSquint_L": 0.25,
        "eyeSquint_R": 0.25, "mouthUpperUp_L": 0.3, "mouthUpperUp_R": 0.3, "jawOpen": 0.08,
    },
    "talk": {
        "jawOpen": 0.24, "mouthFunnel": 0.12, "mouthUpperUp_L": 0.2, "mouthUpperUp_R": 0.2, "mouthLowerDown_L": 0.15,
        "mouthLowerDown_R": 0.15, "browInnerUp_L": 0.25, "browInnerUp_R": 0.25, "eyeWide_L": 0.15, "eyeWide_R": 0.15,
    },
    "blink": {"eyeBlink_L": 1.0, "eyeBlink_R": 1.0, "mouthSmile_L": 0.12, "mouthSmile_R": 0.12},
}  # fmt: skip


def find_expression(name: str) -> Expression:
    """An expression by name.

    Raises:
        NotFoundError: there is none.
    """
    if name not in EXPRESSIONS:
        raise NotFoundError(f"no expression '{name}'", f"use {', '.join(EXPRESSIONS)}")
    return EXPRESSIONS[name]
