"""Dense flow from the motion of control points, by the first-order motion graph (models/first_order_motion)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.live.reenactment.warp import FlowPatch

HEAD_LINES, FEATURE_LINES = 64, 36
"""Rows and columns of the grid over the head and over a feature. With three quarters of them over the head the picture
visibly differs; a lid's gap is some eight rows."""


@dataclass(frozen=True)
class Influence:
    """Where control points go, and how far around them they move the picture.

    Attributes:
        target: (count, 2) float64 source pixels, where each must lie.
        center: (count, 2) float64 source pixels, the middle of its Gaussian.
        strength: (count,) float64, its weight there; 0 is no influence.
    """

    target: NDArray[np.float64]
    center: NDArray[np.float64]
    strength: NDArray[np.float64]


def box_around(points: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    """Left, top, right, bottom of the bounding box of `points` (count, 2), larger by `margin` on each side."""
    return np.concatenate([points.min(axis=0) - margin, points.max(axis=0) + margin])


class DenseMotion:
    """Runs the first-order motion graph that the package contains."""

    def __init__(self, options: SessionOptions) -> None:
        graph = files("relit_camera.live.reenactment").joinpath("first_order_motion.onnx").read_bytes()
        self._session = open_session(graph, "first_order_motion", options)

    def flow(
        self,
        source: NDArray[np.float64],
        influence: Influence,
        radius: NDArray[np.float64],
        unit: float,
        head: NDArray[np.float64],
        features: Sequence[NDArray[np.float64]] = (),
    ) -> tuple[FlowPatch, ...]:
        """The flow that brings `source` to the influence's target, over the head, then over each feature.

        Args:
            source: (count, 2) source pixels.
            influence: where they must go, and how they act there.
            radius: (count,) reach of each point in source pixels.
            unit: source pixels that the graph counts as 1; the eye distance.
            head: left, top, right, bottom in source pixels (4,).
            features: such boxes of what moves more finely.
        """
        middle = influence.target.mean(axis=0)

        def scaled(points: NDArray[np.float64]) -> NDArray[np.float32]:
            return np.asarray((points - middle) / unit, dtype=np.float32)

        def lines(boxes: Sequence[NDArray[np.float64]], count: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
            corners = scaled(np.stack(boxes).reshape(-1, 2, 2))
            x, y = np.linspace(corners[:, 0], corners[:, 1], count, dtype=np.float32).T
            return np.ascontiguousarray(x), np.ascontiguousarray(y)

        columns, rows = lines([head], HEAD_LINES)
        # The graph always has fine grids; where no feature is wanted, one whose flow is not used.
        fine_columns, fine_rows = lines(features or [head], FEATURE_LINES)
        found = self._session.run(
            {
                "source": scaled(source),
                "target": scaled(influence.target),
                "centre": scaled(influence.center),
                "radius": (radius / unit).astype(np.float32)[:, None],
                "strength": influence.strength.astype(np.float32)[:, None],
                "columns": columns,
                "rows": rows,
                "fine_columns": fine_columns,
                "fine_rows": fine_rows,
            }
        )
        flows = [*found["flow"], *found["fine_flow"][: len(features)]]
        return tuple(
            FlowPatch(flow * np.float32(unit), box) for flow, box in zip(flows, [head, *features], strict=True)
        )
