"""Capturing a subject of the person before the running camera: some frames of the webcam, then a worker process.

The worker has a process of its own at low priority, with a time limit, so that neither its load nor an error in it can
stop the camera.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from relit_camera.app.captures.subject_maker import SubjectMaker, require_replaceable
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import ConflictError, DeviceError, RelitError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.folder_redaction import redact_folders
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.capture_status import CaptureStage, CaptureStatus
from relit_camera.live.status.event_hub import EventHub
from relit_camera.subject.rungs import Rung
from relit_camera.subject.subject_store import SubjectStore

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LiveCaptureTimings:
    """Frames and limits of an instant capture.

    Attributes:
        frames: number of frames that are kept.
        longest_side_px: larger ones are reduced to it, as in `relit capture instant`: thirty of 4K are 750 MB.
        interval_s: least time between two of them, in seconds.
        filming_timeout_s: how long the webcam may take to give them; on demand it must be opened first.
        building_timeout_s: after which the worker is ended.
        retry_s: pause before the second attempt, where attempts go on until one succeeds; each is twice as long as the
            one before.
        most_retry_s: the longest of them: an empty chair is looked at now and then.
    """

    frames: int = 30
    longest_side_px: int = 1280
    interval_s: float = 0.08
    filming_timeout_s: float = 12.0
    building_timeout_s: float = 60.0
    retry_s: float = 1.0
    most_retry_s: float = 16.0


REPLACED: tuple[Rung, ...] = ("instant",)
"""What an instant capture may replace."""

SubjectBuilder = Callable[[Sequence[DisplayImage], Path], Sequence[str]]
"""Builds a subject of frames (uint8 sRGB RGB) and writes its file, whole or not at all; returns what the person should
know, a clause each. It must be a function of a module, since another process imports it."""


def require_instant_name(subjects: SubjectStore, name: str, cure: str = "choose another name") -> None:
    """Check that an instant subject may be stored under a name.

    Raises:
        ConflictError: the name belongs to a subject that was captured in a better way; `cure` says what to do.
        InputError: the name is not allowed.
    """
    require_replaceable(subjects, name, REPLACED, cure)


class LiveCapture:
    """Implements `live.camera_control.CaptureControl`: captures a subject while the camera runs, stores and shows it.

    One capture at a time, in a thread of its own.
    """

    def __init__(
        self,
        recorder: FrameRecorder,
        scene_controller: SceneController,
        events: EventHub,
        build: SubjectBuilder,
        wake: Callable[[], None] = lambda: None,
        timings: LiveCaptureTimings = LiveCaptureTimings(),
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up; `start` begins.

        Args:
            recorder: gives the camera's frames.
            scene_controller: stores the subject and shows it.
            events: hears `capture` whenever the status changes.
            build: makes the subject's file.
            wake: called while frames are waited for: on demand, the webcam opens while somebody wants it.
            timings: frames and limits.
            clock: of all waiting.
        """
        self._recorder, self._scene_controller, self._events = recorder, scene_controller, events
        self._wake, self._build, self._timings, self._clock = wake, build, timings, clock
        self._maker = SubjectMaker(scene_controller, events)
        self._lock = threading.Lock()
        self._status = CaptureStatus()
        self._canceled = threading.Event()
        self._thread: threading.Thread | None = None

    def status(self) -> CaptureStatus:
        """How far the last capture is."""
        return self._status

    def start(self, name: str, until_done: bool = False) -> CaptureStatus:
        """Begin to capture a subject, which replaces a stored instant one of that name.

        It is shown, in mode ratio, once it is stored, unless somebody has chosen another one or mode meanwhile.

        Args:
            name: under which it is stored.
            until_done: try again after each failure that a person before the camera can mend.

        Raises:
            ConflictError: a capture runs, or the name belongs to a subject that was captured in a better way.
            InputError: the name is not allowed.
        """
        require_instant_name(self._scene_controller.subjects, name)
        with self._lock:
            if self._thread is not None and self._thread.is_alive():
                raise ConflictError("a capture runs already", "wait for its end, or cancel it")
            self._canceled = threading.Event()
            self._set(CaptureStatus(CaptureStage.FILMING, name))
            arguments = name, until_done, self._canceled, self._maker.shown()
            self._thread = threading.Thread(target=self._run, args=arguments, name="instant-capture", daemon=True)
            self._thread.start()
            return self._status

    def cancel(self) -> CaptureStatus:
        """End the capture that runs, if one does; nothing is stored then."""
        with self._lock:
            thread = self._thread
            self._canceled.set()
        if thread is not None:
            thread.join(2.0)
        return self._status

    def _run(self, name: str, until_done: bool, canceled: threading.Event, before: Scene) -> None:
        """Capture; `before` is what was shown when somebody asked for it."""
        pause_s = self._timings.retry_s
        while True:
            try:
                status = self._attempt(name, canceled, before)
            except RelitError as error:
                what, cure = redact_folders(error.what), redact_folders(error.cure)
                status = CaptureStatus(CaptureStage.FAILED, name, what, cure)
            except Exception as error:  # else nobody would hear that it has ended
                log.exception("the instant capture failed")
                what = redact_folders(f"it failed in a way that nobody expected ({type(error).__name__}: {error})")
                status = CaptureStatus(CaptureStage.FAILED, name, what, "please report it")
            if status.stage is not CaptureStage.DONE and canceled.is_set():
                status = CaptureStatus(CaptureStage.CANCELED, name)
            self._set(status)
            again = until_done and status.stage is CaptureStage.FAILED
            if not again or self._clock.wait(canceled, pause_s):
                return
            pause_s = min(2 * pause_s, self._timings.most_retry_s)
            if self._maker.shown().subject is not before.subject:
                return  # somebody has chosen another one
            self._set(CaptureStatus(CaptureStage.FILMING, name, status.what, status.cure))

    def _attempt(self, name: str, canceled: threading.Event, before: Scene) -> CaptureStatus:
        """Capture once.

        Raises:
            RelitError: there is no usable face, or something else that a person can mend.
        """
        frames = self._film(canceled)
        if canceled.is_set():
            return CaptureStatus(CaptureStage.CANCELED, name)
        self._set(CaptureStatus(CaptureStage.BUILDING, name))
        limit_s = self._timings.building_timeout_s
        notes, not_shown = self._maker.make(
            name, REPLACED, before, self._build, frames, timeout_s=limit_s, canceled=canceled
        )
        return CaptureStatus(CaptureStage.DONE, name, "; ".join(filter(None, [*notes, not_shown])))

    def _film(self, canceled: threading.Event) -> list[DisplayImage]:
        """Frames of the camera.

        Raises:
            DeviceError: it gave none.
        """

        def go_on() -> bool:
            self._wake()
            return not canceled.is_set()

        timings = self._timings
        frames = self._recorder.record(
            timings.frames, timings.interval_s, timings.filming_timeout_s, go_on, timings.longest_side_px
        )
        if not frames:
            raise DeviceError("the webcam gives no frames", "see the status, or `relit devices`")
        return [frame.image for frame in frames]

    def _set(self, status: CaptureStatus) -> None:
        self._status = status
        if status.stage is CaptureStage.FAILED:
            log.warning("instant capture: %s; %s", status.what, status.cure)
        else:
            log.info("instant capture: %s %s", status.stage, status.what)
        self._events.publish("capture", **vars(status))
