"""Plateaus: runs of frames in which the screen shows one pattern, found by how the frames change.

No clock is trusted: the screen, the webcam and the program between them are each late by times that vary.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import Gamma, decode, luminance
from relit_camera.capture.desk.desk_recording import DeskRecording, require_frame


@dataclass(frozen=True)
class PlateauTunables:
    """How plateaus are told from changes, chosen on simulated recordings (docs/desk.md).

    Attributes:
        cells: width and height of the grid of cells to which a frame is reduced.
        min_frames: fewer frames between two changes are no plateau.
        noise_percentile: of the differences of successive frames: that of standing patterns, which are most.
        noise_factor: a difference larger than this many times that is a change,
        min_change: and than this fraction of the largest difference from the mean of all.
    """

    cells: tuple[int, int] = (32, 24)
    min_frames: int = 3
    noise_percentile: float = 35.0
    noise_factor: float = 3.0
    min_change: float = 0.003


TUNABLES = PlateauTunables()


@dataclass(frozen=True)
class Plateau:
    """Frames [start, stop) that show one pattern.

    Attributes:
        start, stop: indices of frames.
        cells: (rows, columns) their mean light.
    """

    start: int
    stop: int
    cells: Float32Array


def frame_cells(
    recording: DeskRecording, progress: Callable[[int, int], None] = lambda done, total: None
) -> Float32Array:
    """Mean linear light (frames, rows, columns) of each frame in a grid of cells."""
    table = decode_table(recording.setup.camera_gamma)
    cells = np.empty((len(recording.frames), *TUNABLES.cells[::-1]), np.float32)
    for index in range(len(recording.frames)):
        frame = require_frame(recording, index)
        # Half the pixels suffice for a mean over hundreds.
        linear = luminance(np.asarray(cv2.LUT(np.ascontiguousarray(frame[::2, ::2]), table), np.float32))
        cells[index] = cv2.resize(linear, TUNABLES.cells, interpolation=cv2.INTER_AREA)
        progress(index + 1, len(recording.frames))
    return cells


def decode_table(gamma: Gamma) -> Float32Array:
    """Linear light (256,) of 8-bit codes."""
    return decode(np.arange(256, dtype=np.float32) / np.float32(255), gamma)


def find_plateaus(cells: Float32Array) -> list[Plateau]:
    """The plateaus of a recording, in order.

    Args:
        cells: (frames, rows, columns) of `frame_cells`.

    Raises:
        CaptureError: the frames never change, or never stand still.
    """
    steps = np.sqrt(np.mean(np.diff(cells, axis=0) ** 2, axis=(1, 2)))
    spread = float(np.sqrt(np.mean((cells - cells.mean(axis=0)) ** 2, axis=(1, 2))).max())
    noise = float(np.percentile(steps, TUNABLES.noise_percentile))
    threshold = max(TUNABLES.noise_factor * noise, TUNABLES.min_change * spread)
    if spread <= 2 * noise or steps.max() <= threshold:
        cure = "the patterns must light the face: darken the room, raise the screen's brightness, come nearer"
        raise CaptureError("no patterns are seen: the frames hardly change", cure)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], steps > threshold, [True]]).astype(np.int8)))
    # A standing run of differences from a to b joins the frames a to b.
    plateaus = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if stop - start + 1 >= TUNABLES.min_frames:
            plateaus.append(Plateau(int(start), int(stop) + 1, cells[start : stop + 1].mean(axis=0)))
    if not plateaus:
        raise CaptureError("no patterns are seen: the frames change all the time", "keep still, and film without zoom")
    return plateaus
