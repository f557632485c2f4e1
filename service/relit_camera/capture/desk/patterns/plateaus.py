"""Plateaus: runs of frames in which the screen shows one pattern, found by how the frames change.

No clock is trusted: the screen, the webcam and the program between them are each late by times that vary. The frames
are parted into runs so that each frame is near the mean of its run, and each run costs something: optimal partitioning
(Jackson et al. 2005, "An Algorithm for Optimal Partitioning of Data on an Interval"). A head that moves in one frame
ends no run, as it would where only successive frames are compared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import percentile_filter

from relit_camera.base.array_types import Float32Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import Gamma, decode, encode, luminance
from relit_camera.capture.desk.desk_recording import DeskRecording, require_frame


@dataclass(frozen=True)
class PlateauTunables:
    """How plateaus are told from changes, chosen on simulated recordings (docs/desk.md).

    Attributes:
        cells: width and height of the grid of cells to which a frame is reduced.
        min_frames: fewer frames between two changes are no plateau.
        noise_percentile: of the differences of successive frames: that of standing patterns, which are most.
        nearby: number of successive differences of which the same percentile is the noise of the frame amid them. Of
            fewer a slow change of pattern, some four frames, would be most, and count as noise.
        max_noise: how many times that of the recording it is at most: a head that drifts, or a picture that is noisy
            where it is dark, is no change of pattern.
        min_noise: noise that is assumed at least, as a fraction of the largest difference from the mean of all frames.
        run_cost: of one more run of frames, in squares of the noise.
        max_run: frames of a run at most, which bounds the work; a longer plateau becomes several.
    """

    cells: tuple[int, int] = (32, 24)
    min_frames: int = 3
    noise_percentile: float = 35.0
    nearby: int = 8
    max_noise: float = 4.0
    min_noise: float = 0.001
    run_cost: float = 20.0
    max_run: int = 200


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


def find_plateaus(cells: Float32Array, gamma: Gamma) -> list[Plateau]:
    """The plateaus of a recording, in order.

    Args:
        cells: (frames, rows, columns) of `frame_cells`.
        gamma: curve of the camera.

    Raises:
        CaptureError: the frames never change, or never stand still.
    """
    # As codes, in which a webcam's noise is about the same in bright frames and in dark ones.
    codes = encode(cells, gamma).reshape(len(cells), -1)
    steps = np.sqrt(np.mean(np.diff(codes, axis=0) ** 2, axis=1))
    spread = float(np.sqrt(np.mean((codes - codes.mean(axis=0)) ** 2, axis=1)).max())
    # Of two frames that both have it, the difference has twice its square.
    noise = float(np.percentile(steps, TUNABLES.noise_percentile)) / np.sqrt(2) if len(steps) else 0.0
    runs = _part(codes, _noise_of_frames(steps, max(noise, TUNABLES.min_noise * spread, 1e-9)))
    if spread <= 2 * np.sqrt(2) * noise or len(runs) == 1:
        cure = "the patterns must light the face: darken the room, raise the screen's brightness, come nearer"
        raise CaptureError("no patterns are seen: the frames hardly change", cure)
    plateaus = [
        Plateau(start, stop, cells[start:stop].mean(axis=0))
        for start, stop in runs
        if stop - start >= TUNABLES.min_frames
    ]
    if not plateaus:
        raise CaptureError("no patterns are seen: the frames change all the time", "keep still, and film without zoom")
    return plateaus


def _noise_of_frames(steps: NDArray[np.floating], noise: float) -> NDArray[np.float64]:
    """Noise (frames,) of each frame, from the differences (frames − 1,) and the noise of the whole recording."""
    if not len(steps):
        return np.array([noise])
    nearby = percentile_filter(steps, TUNABLES.noise_percentile, size=TUNABLES.nearby, mode="nearest") / np.sqrt(2)
    # A frame has a difference before it and one after it.
    both = np.minimum(np.concatenate([nearby[:1], nearby]), np.concatenate([nearby, nearby[-1:]]))
    return np.asarray(np.clip(both, noise, TUNABLES.max_noise * noise), np.float64)


def _part(frames: Float32Array, noise: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Runs [start, stop) that part frames (frames, values) at the least cost, in order.

    A run costs the squared distances of its frames from their mean, per value and in squares of each frame's noise
    (frames,), and `run_cost`.
    """
    weights = 1 / noise**2
    scaled = (frames - frames.mean(axis=0, dtype=np.float64)) / np.sqrt(frames.shape[1])
    sums = _running_sums(scaled * weights[:, None])
    squares, amounts = _running_sums((scaled**2).sum(axis=1) * weights), _running_sums(weights)
    cost, came_from = np.zeros(len(frames) + 1), np.zeros(len(frames) + 1, np.intp)
    for stop in range(1, len(frames) + 1):
        starts = np.arange(max(0, stop - TUNABLES.max_run), stop)
        about_mean = ((sums[stop] - sums[starts]) ** 2).sum(axis=1) / (amounts[stop] - amounts[starts])
        total = cost[starts] + squares[stop] - squares[starts] - about_mean + TUNABLES.run_cost
        cost[stop], came_from[stop] = total.min(), starts[total.argmin()]
    runs, stop = [], len(frames)
    while stop:
        runs.append((int(came_from[stop]), stop))
        stop = int(came_from[stop])
    return runs[::-1]


def _running_sums(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums (count + 1, ...) of the first 0, 1, ... count values (count, ...)."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
