"""Filming a desk capture: a page shows patterns, the running camera's webcam films them with its controls held.

The frames stay in memory as JPEG files until the worker process has made the subject of them.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
from pydantic import ValidationError

from relit_camera.app.background_job import BackgroundJob, describe_failure
from relit_camera.app.captures.desk.controls_note import ControlsNote
from relit_camera.app.captures.subject_maker import SubjectMaker, require_replaceable
from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import CaptureError, DeviceError, InputError
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import Frame
from relit_camera.capture.desk.desk_recording import CameraPlace, DeskSetup, Screen
from relit_camera.capture.desk.desk_session import DeskSession, SessionTimings
from relit_camera.capture.desk.patterns.pattern_sequence import Pattern, pattern_light, standard_sequence
from relit_camera.devices.webcam_controls import ControlDevice, find_exposure, hold_controls
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.desk_status import DeskCaptureStatus, DeskPlace, DeskStage
from relit_camera.live.status.event_hub import EventHub
from relit_camera.subject.rungs import Rung

log = logging.getLogger(__name__)

DeskBuilder = Callable[[Sequence[bytes], str, Path], Sequence[str]]
"""Builds a subject of JPEG frames and the setup's JSON, and writes its file; returns what the person should know, a
clause each. It must be a function of a module, since another process imports it."""


REPLACED: tuple[Rung, ...] = ("instant", "desk")
"""What a desk capture may replace."""

LONGEST_SIDE_PX = 1280
"""Larger frames are reduced to it: a face needs no more."""


@dataclass(frozen=True)
class FilmingTimings:
    """Times and limits of the filming.

    Attributes:
        session: of the steps.
        automatic_s: for which the screen is white before the controls are held: the webcam balances white by it.
        delay_frames: frames until a change of a control shows.
        frame_timeout_s: for one frame; on demand the webcam must be opened first.
        bright_code: code of 255 that the brightest twentieth of the picture's middle reaches under white.
        jpeg_quality: of the frames in memory.
        building_timeout_s: after which the worker is ended.
    """

    session: SessionTimings = field(default_factory=SessionTimings)
    automatic_s: float = 1.5
    delay_frames: int = 5
    frame_timeout_s: float = 5.0
    bright_code: float = 215.0
    jpeg_quality: int = 96
    building_timeout_s: float = 180.0


class DeskFilming:
    """Implements `live.camera_control.DeskCaptureControl`. One capture at a time, in a thread of its own."""

    def __init__(
        self,
        recorder: FrameRecorder,
        scene_controller: SceneController,
        events: EventHub,
        build: DeskBuilder,
        controls: Callable[[], AbstractContextManager[ControlDevice]],
        note: ControlsNote,
        frame_interval_s: Callable[[], float],
        wake: Callable[[], None] = lambda: None,
        timings: FilmingTimings = FilmingTimings(),
        clock: Clock = SYSTEM_CLOCK,
        webcam: threading.Lock | None = None,
    ) -> None:
        """Set up; `start` begins.

        Args:
            recorder: gives the camera's frames.
            scene_controller: stores the subject and shows it.
            events: hears `desk-capture` whenever the stage changes.
            build: makes the subject's file.
            controls: opens the controls of the webcam.
            note: keeps what they were, for the case that this process is killed.
            frame_interval_s: time between two of its frames.
            wake: called while frames are waited for: on demand, the webcam opens while somebody wants it.
            timings: of the filming.
            clock: of all waiting.
            webcam: is held while this runs, by one capture of those that need its frames.
        """
        self._recorder, self._scene_controller, self._events, self._build = recorder, scene_controller, events, build
        self._controls, self._note, self._frame_interval_s, self._wake = controls, note, frame_interval_s, wake
        self._maker = SubjectMaker(scene_controller, events)
        self._timings, self._clock = timings, clock
        self._job = BackgroundJob("desk-capture", "a desk capture runs already", shared=webcam)
        self._lock = threading.RLock()
        self._status = DeskCaptureStatus()
        self._session: DeskSession | None = None
        self._canceled = threading.Event()

    def status(self) -> DeskCaptureStatus:
        """How far the last capture is."""
        with self._lock:
            return self._status

    def start(self, name: str, place: DeskPlace) -> DeskCaptureStatus:
        """Begin to capture a subject, which replaces a stored one of that name that was captured in the same way.

        Args:
            name: under which it is stored.
            place: of screen, webcam and person.

        Raises:
            ConflictError: a capture runs, or the name belongs to a subject that was captured in a better way.
            InputError: the name is not allowed, or the place cannot be.
        """
        setup = _setup(place)
        require_replaceable(self._scene_controller.subjects, name, REPLACED)
        with self._job.taken() as canceled, self._lock:
            self._canceled = canceled
            self._status = DeskCaptureStatus(
                DeskStage.EXPOSING, name, columns=setup.patches.columns, rows=setup.patches.rows
            )
            self._begin_session(DeskStage.EXPOSING, ["white"], setup)
            shown = self._maker.shown()
            self._job.begin(lambda: self._run(name, setup, canceled, shown), lambda ended: self._change(**ended))
            return self._status

    def page_shows(self, step: int) -> DeskCaptureStatus:
        """Note which step the page shows; it must be called several times a second."""
        with self._lock:
            if self._session is not None and self._status.stage.needs_page:
                self._session.page_shows(step)
            return self._status

    def cancel(self) -> DeskCaptureStatus:
        """End the capture that runs, if one does; nothing is stored then."""
        self._job.cancel()
        return self.status()

    def _run(self, name: str, setup: DeskSetup, canceled: threading.Event, before: Scene) -> dict[str, object]:
        """Capture; `before` is what was shown when somebody asked for it. Returns what its end changes."""
        try:
            with self._controls() as device:
                self._white_balance()
                with self._note.until_restored() as keep, hold_controls(device, keep) as held:
                    reached = find_exposure(held, self._brightness, self._timings.bright_code, self._frame_interval_s())
                    log.info("desk capture: %s held, white reads %.0f", ", ".join(held.names), reached)
                    frames = self._film(setup)
            setup = setup.model_copy(update={"locked": held.names})
            self._change(stage=DeskStage.BUILDING, patches=())
            limit_s, text = self._timings.building_timeout_s, setup.model_dump_json()
            notes, not_shown = self._maker.make(
                name, REPLACED, before, self._build, frames, text, timeout_s=limit_s, canceled=canceled
            )
            return {"stage": DeskStage.DONE, "what": "; ".join(filter(None, [*notes, not_shown]))}
        except Exception as error:  # also a fault: else the page would wait for ever
            if canceled.is_set():
                return {"stage": DeskStage.CANCELED, "patches": ()}
            what, cure = describe_failure("desk capture", error)
            return {"stage": DeskStage.FAILED, "patches": (), "what": what, "cure": cure}

    def _white_balance(self) -> None:
        """Wait until the page shows white, and the webcam has adapted to it."""
        while not self._shows_pattern(self._next_frames(1)[0]):
            pass
        ends = self._clock.now() + self._timings.automatic_s
        while self._clock.now() < ends:
            self._next_frames(1)

    def _shows_pattern(self, frame: Frame) -> bool:
        """Whether a frame was captured under the pattern that is to be shown."""
        with self._lock:
            return self._session is not None and self._session.wants_frame(frame.captured_at)

    def _brightness(self) -> float:
        """Code of 255 that the brightest part of the picture's middle has, once the last change shows."""
        image = self._next_frames(self._timings.delay_frames)[-1].image
        height, width = image.shape[:2]
        middle = image[height // 6 : 5 * height // 6, width // 4 : 3 * width // 4].max(axis=2)
        return float(np.percentile(cv2.resize(middle, (64, 64), interpolation=cv2.INTER_AREA), 95))

    def _film(self, setup: DeskSetup) -> list[bytes]:
        """The frames of all patterns, as JPEG files."""
        session = self._begin_session(DeskStage.FILMING, setup.patterns, setup)
        frames: list[bytes] = []
        while not session.is_done:
            frame = self._next_frames(1)[0]
            with self._lock:
                wanted = session.wants_frame(frame.captured_at)
                if wanted:
                    session.frame_taken()
                step = session.step
                session.advance()
                if session.step != step and not session.is_done:
                    self._show_step(session.step, setup.patterns, setup)
            if wanted:
                frames.append(encode_display(frame.image, ".jpg", self._timings.jpeg_quality))
        return frames

    def _next_frames(self, count: int) -> list[Frame]:
        """The next frames of the webcam.

        Raises:
            CaptureError: it was canceled, or the page is gone.
            DeviceError: the webcam gives none.
        """

        def go_on() -> bool:
            self._wake()
            self._require_alive()
            return True

        frames = self._recorder.record(count, 0.0, self._timings.frame_timeout_s, go_on, LONGEST_SIDE_PX)
        self._require_alive()
        if len(frames) < count:
            raise DeviceError("the webcam gives no frames", "see the status, or `relit devices`")
        return frames

    def _require_alive(self) -> None:
        if self._canceled.is_set():
            raise CaptureError("the capture was canceled", "start it again")
        with self._lock:
            if self._session is not None:
                self._session.require_alive()

    def _begin_session(self, stage: DeskStage, patterns: Sequence[Pattern], setup: DeskSetup) -> DeskSession:
        with self._lock:
            timings = self._timings.session
            if stage is DeskStage.EXPOSING:  # one step that lasts until the exposure is found
                timings = replace(timings, step_timeout_s=60.0)
            session = self._session = DeskSession(patterns, self._clock, timings)
            self._status = replace(self._status, stage=stage, steps=len(patterns))
            self._show_step(0, patterns, setup)
            return session

    def _show_step(self, step: int, patterns: Sequence[Pattern], setup: DeskSetup) -> None:
        pattern = patterns[step]
        values = pattern_light(pattern, setup.patches.count, 1.0) if isinstance(pattern, str) else np.array(pattern)
        self._change(step=step, patches=tuple(float(value) for value in values))

    def _change(self, **changes: object) -> None:
        with self._lock:
            before, self._status = self._status.stage, replace(self._status, **changes)  # type: ignore[arg-type]
            status = self._status
        if status.stage is not before:
            self._events.publish("desk-capture", stage=str(status.stage), what=status.what, cure=status.cure)


def _setup(place: DeskPlace) -> DeskSetup:
    """The setup of a place, which cannot be wrong in its form, only in its values.

    Raises:
        InputError: a value is out of range.
    """
    try:
        setup = DeskSetup(
            screen=Screen(width_cm=place.screen_width_cm, height_cm=place.screen_height_cm),
            distance_cm=place.distance_cm,
            camera=CameraPlace(up_cm=place.camera_up_cm, right_cm=place.camera_right_cm),
        )
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        name = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{name}: {first['msg']}", "measure in centimeters") from error
    grid = setup.patches
    sequence = standard_sequence(grid.columns, grid.rows, place.one_by_one)
    return setup.model_copy(update={"sequence": sequence})
