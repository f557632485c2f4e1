"""Dense flow from the motion of control points, by the first-order motion graph (models/first_order_motion)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.live.reenactment.warp import FlowPatch


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


@dataclass(frozen=True)
class Region:
    """Part of the source image where flow is wanted.

    Attributes:
        box: (4,) float64 left, top, right, bottom in source pixels.
        rows, columns: of its grid.
    """

    box: NDArray[np.float64]
    rows: int
    columns: int

    @property
    def grid(self) -> NDArray[np.float64]:
        """Grid positions (rows · columns, 2) in source pixels, the corners at the box's."""
        x = np.linspace(self.box[0], self.box[2], self.columns)
        y = np.linspace(self.box[1], self.box[3], self.rows)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def region_around(points: NDArray[np.float64], margin: float, rows: int, columns: int) -> Region:
    """The region of a bounding box of `points` (count, 2), larger by `margin` pixels on each side."""
    return Region(np.concatenate([points.min(axis=0) - margin, points.max(axis=0) + margin]), rows, columns)


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
        regions: Sequence[Region],
    ) -> tuple[FlowPatch, ...]:
        """The flow that brings `source` to the influence's target, on the grid of each region.

        Args:
            source: (count, 2) source pixels.
            influence: where they must go, and how they act there.
            radius: (count,) reach of each point in source pixels.
            unit: source pixels that the graph counts as 1; the eye distance.
            regions: where flow is wanted.
        """
        middle = influence.target.mean(axis=0)

        def scaled(points: NDArray[np.float64]) -> NDArray[np.float32]:
            return np.asarray((points - middle) / unit, dtype=np.float32)

        flow = self._session.run(
            {
                "source": scaled(source),
                "target": scaled(influence.target),
                "centre": scaled(influence.center),
                "radius": (radius / unit).astype(np.float32)[:, None],
                "strength": influence.strength.astype(np.float32)[:, None],
                "grid": scaled(np.vstack([region.grid for region in regions])),
            }
        )["flow"] * np.float32(unit)
        patches, start = [], 0
        for region in regions:
            stop = start + region.rows * region.columns
            patches.append(FlowPatch(flow[start:stop].reshape(region.rows, region.columns, 2), region.box))
            start = stop
        return tuple(patches)
