"""Gains of the camera's automatic exposure and white balance, per frame and channel.

A phone adjusts exposure and white balance for every frame, so that a dark frame subtracted from a bright one leaves a
blue or an orange face (thesis 4.3.5). The wall far behind the person has the same light all the time: how its picture
changes shows the gains. Without such a part of the picture, dark frames show their own gains, and those of the bright
ones are interpolated over time.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.film.flash.flash_signal import NOISE_FLOOR


@dataclass(frozen=True)
class GainTunables:
    """Estimation of gains; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        grid_side: cells along the longer side of the grid in which gains are estimated.
        min_visible, max_unclipped: least median of a cell over the frames, and largest of its values: darker cells are
            noise, brighter ones clip.
        least_response: percentile of the cells' response to the flash that stands for no response.
        response_margin: logarithm by which the response of a cell beyond the flash's reach may exceed that.
        reached_everywhere: the flash reaches everything if that response exceeds this fraction of the 95th percentile.
        min_fraction: least fraction of all cells that must be beyond the flash's reach.
        max_residual_ratio: cells with a residual beyond this multiple of the median are left out, as something moves
            there.
        max_room_left: largest fraction of the room's light that a subtraction may leave.
        max_spread: spread of the gains within a frame from which the camera did more than expose and balance.
    """

    grid_side: int = 96
    min_visible: float = 0.015
    max_unclipped: float = 0.85
    least_response: float = 5.0
    response_margin: float = 0.06
    reached_everywhere: float = 0.3
    min_fraction: float = 0.02
    max_residual_ratio: float = 2.5
    max_room_left: float = 0.5
    max_spread: float = 0.1


_TUNABLES = GainTunables()


@dataclass(frozen=True, eq=False)
class FrameGains:
    """The camera's gains.

    Attributes:
        rgb: (frames, 3) of each frame by channel; the geometric mean over the bright frames is 1.
        spread: deviation of a frame's cells from its gain (robust standard deviation of logarithms, median over the
            frames): hardly more than noise where the camera applied nothing but one gain a channel.
        fraction: of all cells, those from which the gains were estimated; 0 where too few are beyond the flash's reach.
        visible: fraction of all cells that show the room without the flash, neither too dark nor clipped. If it is not
            small but `fraction` is 0, the flash reaches everything.
        left_as_is, left: fraction of the room's light that remains, of either sign, where a dark frame is subtracted
            from a bright one as they are, and with gains divided out.
    """

    rgb: Float64Array
    spread: float
    fraction: float
    visible: float
    left_as_is: float
    left: float

    @property
    def too_dim(self) -> bool:
        """Whether the room is too dark or too bright to show the gains, rather than reached by the flash."""
        return not self.fraction and self.visible < _TUNABLES.min_fraction

    @property
    def source(self) -> str:
        """Where the gains are from, for people."""
        return "what the flash does not reach" if self.fraction else "dark frames, and time between them"

    @property
    def can_subtract_room(self) -> bool:
        """Whether subtracting the room's light leaves less than half of it."""
        return self.left < _TUNABLES.max_room_left


def downsample_for_gains(frame: LinearImage) -> NDArray[np.float16]:
    """Means (rows, columns, 3) of a frame, linear RGB (height, width, 3), in 96 cells along its longer side."""
    height, width = frame.shape[:2]
    scale = min(1.0, _TUNABLES.grid_side / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), np.float16)


def estimate_gains(
    cells: NDArray[np.float16], times_s: Float64Array, bright: NDArray[np.bool_], flash: NDArray[np.intp]
) -> FrameGains:
    """Gains of bright and dark frames.

    Args:
        cells: (frames, rows, columns, 3) by `downsample_for_gains`, of bright and dark frames in their order.
        times_s: (frames,) growing.
        bright: (frames,) which frames are bright; at least one is dark.
        flash: (frames,) number of each frame's flash.
    """
    frames, rows, columns, _ = cells.shape
    flat = cells.reshape(frames, rows * columns, 3)
    least, most = flat.min(axis=2).min(axis=0), flat.max(axis=2).max(axis=0)
    visible = np.median(flat, axis=0).mean(axis=1) > _TUNABLES.min_visible
    visible &= (least > 0) & (most < _TUNABLES.max_unclipped)
    of_room = np.median(flat[~bright], axis=0).mean(axis=1) > _TUNABLES.min_visible
    unreached = _unreached(flat, times_s, bright, flash, visible)
    fraction = float(unreached.mean())
    if fraction >= _TUNABLES.min_fraction:
        room = flat[:, unreached]
        logs, spread = _common_gains(room)
    else:
        fraction, room = 0.0, flat[:, visible]
        logs, spread = _interpolated_gains(room, times_s, bright)
    logs -= logs[bright].mean(axis=0)
    gains = np.exp(logs)
    judged = np.flatnonzero(bright if fraction else ~bright)
    left_as_is, left = (
        _room_left(room, each, judged, np.flatnonzero(~bright)) for each in (np.ones_like(gains), gains)
    )
    return FrameGains(gains, spread, fraction, float((visible & of_room).mean()), left_as_is, left)


def require_uniform_gains(spread: float) -> None:
    """Check that one gain a channel explains what the camera did to a frame.

    Args:
        spread: `FrameGains.spread`.

    Raises:
        CaptureError: it does not; the camera processes parts of the picture by themselves.
    """
    if spread > _TUNABLES.max_spread:
        raise CaptureError(
            f"the camera changes parts of the picture by themselves, by {spread:.0%} where only the room shows",
            "turn off HDR, night mode, beauty and other enhancements, or film with an app that locks the exposure",
        )


def _unreached(
    flat: NDArray[np.float16],
    times_s: Float64Array,
    bright: NDArray[np.bool_],
    flash: NDArray[np.intp],
    visible: NDArray,
) -> NDArray[np.bool_]:
    """Mask (cells,) of the visible cells that respond least to the flash; none if all respond."""
    light = np.log(flat.astype(np.float32).mean(axis=2) + np.float32(NOISE_FLOOR))
    dark_s, dark = times_s[~bright], light[~bright]
    steps = []
    for number in np.unique(flash[bright]):
        lit = bright & (flash == number)
        before = int(np.clip(np.searchsorted(dark_s, times_s[lit].mean()), 1, max(1, len(dark_s) - 1)))
        around = dark[before - 1 : before + 1]
        steps.append(light[lit].mean(axis=0) - around.mean(axis=0))
    response = np.median(steps, axis=0)
    if not visible.any():
        return visible
    low, high = np.percentile(response[visible], [_TUNABLES.least_response, 95])
    if low > _TUNABLES.reached_everywhere * high and low > _TUNABLES.response_margin:
        return np.zeros_like(visible)
    return np.asarray(visible & (response < low + _TUNABLES.response_margin))


def _common_gains(cells: NDArray[np.float16]) -> tuple[Float64Array, float]:
    """Logarithms (frames, 3) of the gains common to all cells (frames, cells, 3), and the cells' spread about them."""
    logs = np.log(cells.astype(np.float32) + np.float32(NOISE_FLOOR))
    logs -= logs.mean(axis=0)
    gains = np.median(logs, axis=1)
    residual = np.abs(logs - gains[:, None]).mean(axis=(0, 2))
    steady = residual <= _TUNABLES.max_residual_ratio * np.median(residual)
    logs = logs[:, steady]
    gains = np.median(logs, axis=1)
    spread = 1.4826 * float(np.median(np.median(np.abs(logs - gains[:, None]), axis=1)))
    return gains.astype(np.float64), spread


def _interpolated_gains(
    cells: NDArray[np.float16], times_s: Float64Array, bright: NDArray[np.bool_]
) -> tuple[Float64Array, float]:
    """Logarithms (frames, 3) of gains, measured in dark frames and interpolated in bright ones; and the spread."""
    if cells.shape[1] == 0:
        return np.zeros((len(times_s), 3)), 0.0
    dark, spread = _common_gains(cells[~bright])
    logs = np.stack([np.interp(times_s, times_s[~bright], channel) for channel in dark.T], axis=1)
    return logs, spread


def _room_left(cells: NDArray[np.float16], gains: Float64Array, judged: Indices, dark: Indices) -> float:
    """Median fraction of the room's light in cells (frames, cells, 3) that is left without the nearest dark frame."""
    if cells.shape[1] == 0:
        return 1.0
    fractions = []
    for index in judged:
        others = dark[dark != index]
        other = others[np.abs(others - index).argmin()]
        light, room = (cells[each].astype(np.float32) / gains[each] for each in (index, other))
        fractions.append(np.median(np.abs(light - room).sum(axis=1) / np.maximum(room.sum(axis=1), NOISE_FLOOR)))
    return float(np.median(fractions))
