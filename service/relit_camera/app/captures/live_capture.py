"""Capturing a subject of the person before the running camera: some frames of the webcam, then a worker process.

The worker has a process of its own at low priority, with a time limit, so that neither its load nor an error in it can
stop the camera.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from relit_camera.app.background_job import BackgroundJob, describe_failure
from relit_camera.app.captures.subject_maker import SubjectMaker, require_replaceable
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_types import DisplayImage
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
        webcam: threading.Lock | None = None,
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
            webcam: is held during an attempt, by one capture of those that need its frames.
        """
        self._recorder, self._scene_controller, self._events = recorder, scene_controller, events
        self._wake, self._build, self._timings, self._clock = wake, build, timings, clock
        self._maker = SubjectMaker(scene_controller, events)
        self._job = BackgroundJob("instant-capture", "a capture runs already", shared=webcam)
        self._status = CaptureStatus()

    def status(self) -> CaptureStatus:
        """How far the last capture is."""
        return self._status

    def start(self, name: str, until_done: bool = False) -> CaptureStatus:
        """Begin to capture a subject, which replaces a stored instant one of that name.

        It is shown, in mode live, once it is stored, unless somebody has chosen another one or mode meanwhile. It ends
        a capture that pauses before its next attempt.

        Args:
            name: under which it is stored.
            until_done: try again after each failure that a person before the camera can mend.

        Raises:
            ConflictError: a capture runs, also of another kind, or the name belongs to a subject that was captured in a
                better way.
            InputError: the name is not allowed.
        """
        require_instant_name(self._scene_controller.subjects, name)
        with self._job.lock:
            if self._pauses:
                # One that is refused, since another kind of capture has the webcam, must not end the one that waits.
                self._job.require_shared()
                self._job.cancel()
        with self._job.taken() as canceled:
            self._set(CaptureStatus(CaptureStage.FILMING, name))
            shown = self._maker.shown()
            self._job.begin(lambda: self._run(name, until_done, canceled, shown), self._set)
            return self._status

    def cancel(self) -> CaptureStatus:
        """End the capture that runs, if one does; nothing is stored then."""
        self._job.cancel()
        return self._status

    @property
    def _pauses(self) -> bool:
        """Whether a capture runs that waits for its next attempt."""
        return self._job.is_running and not self._status.stage.is_running

    def _run(self, name: str, until_done: bool, canceled: threading.Event, before: Scene) -> CaptureStatus:
        """Capture; `before` is what was shown when somebody asked for it. Returns how it ended."""
        pause_s = self._timings.retry_s
        while True:
            try:
                status = self._attempt(name, canceled, before)
            except Exception as error:  # also a fault: else nobody would hear that it has ended
                if canceled.is_set():
                    return CaptureStatus(CaptureStage.CANCELED, name)
                what, cure = describe_failure("instant capture", error)
                status = CaptureStatus(CaptureStage.FAILED, name, what, cure)
            if not until_done or status.stage is not CaptureStage.FAILED:
                return status
            with self._job.lock:
                self._job.leave_shared()
                self._set(status)
            begins = False
            while not begins:
                if self._clock.wait(canceled, pause_s):
                    return CaptureStatus(CaptureStage.CANCELED, name)
                if not self._maker.shown().has_same_subject(before):
                    return status  # somebody has chosen another one
                begins = self._begin_again(canceled, status)
            pause_s = min(2 * pause_s, self._timings.most_retry_s)

    def _begin_again(self, canceled: threading.Event, failed: CaptureStatus) -> bool:
        """Begin the next attempt after one that failed, unless it was canceled or the webcam's frames are taken."""
        with self._job.lock:
            begins = not canceled.is_set() and self._job.take_shared()
            if begins:
                self._set(replace(failed, stage=CaptureStage.FILMING))
        return begins

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
        if status == self._status:
            return
        self._status = status
        if status.stage is not CaptureStage.FAILED:  # what failed is in the log already
            log.info("instant capture: %s %s", status.stage, status.what)
        self._events.publish("capture", **vars(status))
