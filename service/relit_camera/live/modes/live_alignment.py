"""Where a live picture looks in the source image, corrected by what both show.

Landmarks tell where the face lies, within a pixel or two. Where shoulders, collar, ears and hair lie is a guess from
the pose of the head, and there the ratio would set the light of cloth on skin. Under the room's light the source image
is what the live picture shows, so the optical flow between the two (DIS: Kroeger et al., ECCV 2016) tells how far both
are off. Single flows err where there is little to see: they are averaged over the neighborhood in the source image and
over some frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Flow, Mask
from relit_camera.live.modes.live_detail import Cells, mean_of_channels
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.warp import PositionGrid


@dataclass(frozen=True)
class LiveAlignmentTunables:
    """Constants, chosen on one rendered person in six rooms and two lights (`bea` in docs/evaluate.md).

    Half or twice of `reach`, `spacing`, `blur` and `prior` changes no part of the person by more than 0.2 dB. With
    patches of 8 pixels the far cheek has 0.5 dB less and the neck 0.2, with 8 pixels an eye distance the far cheek 0.6
    and the face 0.3.

    Attributes:
        resolution: pixels an eye distance of the pictures that are compared; at most as many as there are cells.
        patch, stride: side of the patches of the flow, and their distance, in these pixels.
        reach: flow of which half is believed, in eye distances.
        spacing: of the nodes at which the correction is kept, in eye distances.
        blur: sigma of the neighborhood, in nodes.
        prior: weight of no correction, where nodes that are seen wholly have 1 in the mean.
        interval_s: time between two flows.
        time_constant_s: of the average over time.
        mean_code: what the person's mean root becomes in the pictures that are compared, of 255.
        dark_root: mean root below which they are not made brighter: there is little but noise.
    """

    resolution: float = 12.0
    patch: int = 4
    stride: int = 2
    reach: float = 0.3
    spacing: float = 0.05
    blur: float = 1.0
    prior: float = 0.05
    interval_s: float = 0.15
    time_constant_s: float = 0.25
    mean_code: float = 75.0
    dark_root: float = 0.1


TUNABLES = LiveAlignmentTunables()
_SEEN = 0.02
"""Confidence above which a cell shows the person."""
_LEAST_SIDE = 16
"""Pixels: of smaller pictures OpenCV gives no flow."""


@dataclass(frozen=True)
class ComparedCells:
    """Cells of a live frame, and what the source image has where they look.

    Attributes:
        live: (rows, columns, 3) roots of the live picture's light.
        under_room: the same of the source image under the room's light, in the live frame's exposure.
        confidence: (rows, columns) how far a cell can be compared, 0..1: it is the person's, and not overexposed.
        looks: (rows, columns, 2) float32 source pixels, as OpenCV counts them.
        unit: the eye distance in cells.
    """

    live: Cells
    under_room: Cells
    confidence: Cells
    looks: NDArray[np.float32]
    unit: float


class LiveAlignment:
    """Corrects where live pictures look in one source image. Not thread-safe."""

    def __init__(self, face: SourceFace) -> None:
        """Begin without a correction.

        Args:
            face: the face in the source image.
        """
        width, height = face.size
        self._spacing = TUNABLES.spacing * face.scheme.eye_span(face.landmarks)
        self._shape = int(np.ceil(height / self._spacing)), int(np.ceil(width / self._spacing))
        # Sums of weight, and of weight times correction in source pixels.
        self._sums = np.zeros((*self._shape, 3), np.float32)
        self._correction: Flow = np.zeros((*self._shape, 2), np.float32)
        self._updated_s: float | None = None
        # Without the variational refinement, which takes as long as the rest and gains nothing here.
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        self._flow.setFinestScale(0)
        self._flow.setPatchSize(TUNABLES.patch)
        self._flow.setPatchStride(TUNABLES.stride)
        self._flow.setVariationalRefinementIterations(0)

    def is_due(self, time_s: float) -> bool:
        """Whether the correction should be found anew for a frame of that time."""
        return self._updated_s is None or not 0 <= time_s - self._updated_s < TUNABLES.interval_s

    def update(self, cells: ComparedCells, time_s: float) -> None:
        """Find the correction anew, unless so little of the person is seen that there is nothing to go by.

        Args:
            cells: of a live frame; they look where they did before any correction.
            time_s: of that frame.
        """
        shrink = min(TUNABLES.resolution / cells.unit, 1.0)
        size = [round(side * shrink) for side in cells.confidence.shape[::-1]]
        if min(size) < _LEAST_SIDE:
            return
        elapsed = np.inf if self._updated_s is None else time_s - self._updated_s
        kept = np.exp(-elapsed / TUNABLES.time_constant_s) if elapsed > 0 else 0.0
        self._updated_s = time_s
        unit = shrink * cells.unit
        found = self._on_nodes(*_moved(self._flow, cells, size, unit), unit)
        self._sums = cv2.addWeighted(self._sums, float(kept), found, float(1 - kept), 0)
        weight, x, y = cv2.split(cv2.GaussianBlur(self._sums, (0, 0), TUNABLES.blur))
        weight += np.float32(TUNABLES.prior)
        self._correction = cv2.merge([x / weight, y / weight])

    def corrected(self, positions: PositionGrid) -> PositionGrid:
        """The positions, in source pixels, with the latest correction."""
        nodes = positions.positions / np.float32(self._spacing)
        nodes -= np.float32(0.5)
        change = cv2.remap(self._correction, nodes, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return replace(positions, positions=positions.positions + change)

    def _on_nodes(self, looks: NDArray[np.float32], change: Flow, weight: Mask, unit: float) -> NDArray[np.float32]:
        """Sums of weight and of weight times change, of all pixels that look at each node: (rows, columns, 3).

        Nodes at which as many look as the eye distance `unit` in pixels says have the weight 1 in the mean.
        """
        rows, columns = self._shape
        column, row = np.floor((looks + 0.5) / self._spacing).astype(np.int32).transpose(2, 0, 1)
        inside = (weight > 0) & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        node, counted = (row * columns + column)[inside], weight[inside]
        full = (TUNABLES.spacing * unit) ** 2
        sums = [
            np.bincount(node, each, minlength=rows * columns) / full
            for each in (counted, *(change[inside].T * counted))
        ]
        return np.stack(sums, axis=-1).reshape(rows, columns, 3).astype(np.float32)


def _moved(
    flow: cv2.DISOpticalFlow, cells: ComparedCells, size: list[int], unit: float
) -> tuple[NDArray[np.float32], Flow, Mask]:
    """What the flow of the live picture toward the source image says, in pictures of `size` (width, height).

    Of each pixel where it looks, by how many source pixels it should look elsewhere, and the weight of that; `unit` is
    the eye distance in these pixels.
    """
    reduced = cv2.INTER_AREA if size[0] < cells.confidence.shape[1] else cv2.INTER_LINEAR
    live, known, confidence, looks = (
        np.asarray(cv2.resize(each, size, interpolation=reduced))
        for each in (mean_of_channels(cells.live), mean_of_channels(cells.under_room), cells.confidence, cells.looks)
    )
    mean = float((known * confidence).sum()) / max(float(confidence.sum()), 1e-6)
    gain = TUNABLES.mean_code / max(mean, TUNABLES.dark_root)
    # Beside the person the source image has nothing: there both are the same, so that no wall pulls at the outline.
    known = live + (known - live) * confidence
    first, second = (cv2.convertScaleAbs(each, alpha=gain) for each in (live, known))
    found = flow.calc(first, second, None)
    rows, columns = confidence.shape
    there = found + np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).astype(np.float32)
    change = cv2.remap(looks, there, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) - looks
    length = cv2.magnitude(*cv2.split(found)) / np.float32(TUNABLES.reach * unit)
    weight = np.where(confidence > _SEEN, 1 / (1 + length**4), 0)
    return looks, change, weight
