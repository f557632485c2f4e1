"""A webcam as source: it is found by its stable id, and opened again after it was away."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from relit_camera.base.errors import DeviceError, RelitError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, VIRTUAL_CAMERA_LABEL, DeviceFolders, find_webcam
from relit_camera.devices.sources.source import SourceInfo, SourceState, ThreadedSource

MIN_STALL_TIMEOUT_S = 2.0

FIRST_FRAME_TIMEOUT_S = 5.0
"""A camera may take this long to give its first frame."""

BACKOFF_S = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Pauses between attempts to open the camera; the last one repeats for ever."""


LOG_LEVEL_ERROR = 2


class OpenCvCapture(Protocol):
    """The part of `cv2.VideoCapture` that is used."""

    def isOpened(self) -> bool: ...  # noqa: N802, D102
    def read(self) -> tuple[bool, np.ndarray | None]: ...  # noqa: D102
    def release(self) -> None: ...  # noqa: D102


class WebcamSource(ThreadedSource):
    """Gives the newest frame of a webcam. OpenCV is only called in the reader thread.

    A camera that is away (unplugged, suspended, used by another program) is searched for until it is back.
    """

    def __init__(
        self,
        text: str,
        size: tuple[int, int],
        fps: float,
        *,
        tree: DeviceFolders = SYSTEM_FOLDERS,
        own_label: str = VIRTUAL_CAMERA_LABEL,
        open_capture: Callable[[str, tuple[int, int], float], OpenCvCapture] | None = None,
        stall_timeout_s: float | None = None,
    ) -> None:
        """Choose a camera; it is opened by the first `read`.

        Args:
            text: `webcam`, or an id, name or node of `find_webcam`.
            size: width and height to ask for; the camera may choose others.
            fps: frames a second to ask for.
            tree: the folders in which devices are found.
            own_label: label of the virtual camera that is published to, which is never opened.
            open_capture: opens (node, size, fps); OpenCV if not given.
            stall_timeout_s: seconds without a frame after which the source has stalled.

        Raises:
            DeviceError: there is no such camera now.
        """
        self._webcam = find_webcam(text, tree, own_label)
        super().__init__(SourceInfo("webcam", self._webcam.id, size, fps))
        self._tree, self._own_label = tree, own_label
        self._open_capture = open_capture or open_with_opencv
        self._stall_timeout_s = stall_timeout(fps) if stall_timeout_s is None else stall_timeout_s
        self._last_frame_at = 0.0
        self._index = 0

    @property
    def state(self) -> SourceState:
        """The state of the source; whether it has stalled is checked here."""
        silent_s = time.monotonic() - self._last_frame_at
        if silent_s > self._stall_timeout_s:
            self._machine.transition(SourceState.STALLED, only_from=SourceState.RUNNING)
        return self._machine.state

    @property
    def reason(self) -> str:
        """One line saying why no frames come; empty while they do."""
        return f"{self._webcam.name} gives no pictures" if self.state is SourceState.STALLED else self._reason

    def _produce(self) -> None:
        start = time.monotonic()
        failures = 0
        while not self._stopping.is_set():
            self._machine.transition(SourceState.OPENING)
            failures = 0 if self._try(start) else failures
            if self._stopping.is_set():
                return
            self._machine.transition(SourceState.RECONNECTING)
            self._stopping.wait(BACKOFF_S[min(failures, len(BACKOFF_S) - 1)])
            failures += 1

    def _try(self, start: float) -> bool:
        """Open the camera and publish its frames while they come. Returns whether any came."""
        capture = self._open()
        if capture is None:
            return False
        try:
            return self._pump(capture, start)
        except (RelitError, cv2.error) as error:  # the driver gave no valid picture; the next may be one
            self._reason = f"{self._webcam.name} gives what is no picture: {error}"
            return False
        finally:
            capture.release()

    def _open(self) -> OpenCvCapture | None:
        """Open the camera, which may have another node than before; None, with `reason` set, if it cannot be opened."""
        try:
            self._webcam = find_webcam(self._info.id, self._tree, self._own_label)
        except DeviceError:
            self._reason = f"{self._webcam.name} is unplugged"
            return None
        if not self._node_exists():
            self._reason = f"{self._webcam.name} is unplugged"
            return None
        capture = self._open_capture(self._webcam.node, self._info.size, self._info.fps)
        if capture.isOpened():
            return capture
        capture.release()
        self._reason = f"{self._webcam.name} cannot be opened: another program may be using it"
        return None

    def _pump(self, capture: OpenCvCapture, start: float) -> bool:
        """Publish frames until they fail to come. Returns whether any came."""
        came = False
        give_up_at = time.monotonic() + max(FIRST_FRAME_TIMEOUT_S, self._stall_timeout_s)
        while not self._stopping.is_set():
            done, bgr = capture.read()
            now = time.monotonic()
            if done and bgr is not None and bgr.size:
                self._last_frame_at, came = now, True
                give_up_at = now + self._stall_timeout_s
                self._publish(Frame(_rgb(bgr), self._index, now, now - start))
                self._index += 1
            elif now > give_up_at or not self._node_exists():
                self._reason = f"{self._webcam.name} gives no pictures"
                return came
            else:
                self._stopping.wait(0.01)  # a failed read may return at once
        return came

    def _node_exists(self) -> bool:
        return self._webcam.node.isdigit() or Path(self._webcam.node).exists()

    def _publish(self, frame: Frame) -> None:
        if frame.size != self._info.size:
            self._info = SourceInfo(self._info.kind, self._info.id, frame.size, self._info.fps)
        super()._publish(frame)


def stall_timeout(fps: float) -> float:
    """Seconds without a frame after which a source of that rate has stalled: four intervals, but at least two."""
    return max(MIN_STALL_TIMEOUT_S, 4 / fps)


def open_with_opencv(node: str, size: tuple[int, int], fps: float) -> OpenCvCapture:
    """Open a device by OpenCV and ask for Motion-JPEG, this size and rate, and a queue of one."""
    # Longest wait of `read` in seconds, which must not delay closing; OpenCV reads the variable at its first wait.
    os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")
    # Errors only: a camera that is busy or away is reported by the source itself. OpenCV 5 moved the function.
    set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel
    set_log_level(LOG_LEVEL_ERROR)
    if node.isdigit():
        capture = cv2.VideoCapture(int(node))
    else:
        capture = cv2.VideoCapture(node, cv2.CAP_V4L2 if sys.platform.startswith("linux") else cv2.CAP_ANY)
    if capture.isOpened():
        # First the format: many cameras give 5 frames a second uncompressed at this size.
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, size[0])
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, size[1])
        capture.set(cv2.CAP_PROP_FPS, fps)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    opened: OpenCvCapture = capture
    return opened


def _rgb(bgr: np.ndarray) -> DisplayImage:
    code = cv2.COLOR_GRAY2RGB if bgr.ndim == 2 else cv2.COLOR_BGR2RGB
    image: DisplayImage = cv2.cvtColor(bgr, code)
    return image
