"""Filming expression stills with the running camera's webcam: what to do is asked for until the frames show it.

What they show is measured as it is in a film, by the tracker that reads films, frame by frame.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import CaptureError, DeviceError
from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import Frame
from relit_camera.face.face_state import Tracker
from relit_camera.live.frame_recorder import FrameRecorder

if TYPE_CHECKING:  # imported late: what only captures need would make the camera start later
    from relit_camera.capture.expressions.film_tracking import TrackedFilm
    from relit_camera.capture.expressions.still_selection import Selection

CALLED = "the webcam's picture"
"""What the film is called in messages."""
UNSEEN_S = 1.0
"""So long without a face it is told that none is seen: shut lids and far turns hide it for a moment."""


@dataclass(frozen=True)
class GuidedTimings:
    """Frames and limits of the filming.

    Attributes:
        longest_side_px: larger frames are reduced to it: a face needs no more.
        interval_s: least time between two frames.
        frame_timeout_s: how long the webcam may take for one; on demand it must be opened first.
        lost_s: for how long no face may be seen.
        jpeg_quality: of the frames in memory.
    """

    longest_side_px: int = 1280
    interval_s: float = 0.06
    frame_timeout_s: float = 12.0
    lost_s: float = 10.0
    jpeg_quality: int = 96


@dataclass(frozen=True)
class FilmingState:
    """How far the filming is.

    Attributes:
        prompt: name of what the person should do now.
        say: the same as a clause.
        face: whether the face is seen.
        covered: names of what the frames show.
        progress: 0 to 1.
    """

    prompt: str
    say: str
    face: bool
    covered: tuple[str, ...]
    progress: float


@dataclass(frozen=True)
class FilmedStills:
    """What is needed to make stills.

    Attributes:
        film: the faces in all frames.
        selection: those that become stills.
        frames: by index, in order of time, JPEG files of the frames that are needed, black beyond the face.
    """

    film: TrackedFilm
    selection: Selection
    frames: dict[int, bytes]


def open_film_tracker() -> Tracker:
    """The tracker by which films are read.

    Raises:
        ModelError: its networks are not there.
    """
    from relit_camera.capture.instant.face_selection import TRACKER
    from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker

    return open_tracker(TRACKER, TrackerOptions(blendshapes=False))


class GuidedFilming:
    """Films the person before the webcam, once at a time."""

    def __init__(
        self,
        recorder: FrameRecorder,
        wake: Callable[[], None] = lambda: None,
        new_tracker: Callable[[], Tracker] = open_film_tracker,
        timings: GuidedTimings = GuidedTimings(),
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up.

        Args:
            recorder: gives the camera's frames.
            wake: called while frames are waited for: on demand, the webcam opens while somebody wants it.
            new_tracker: opens what follows the face.
            timings: frames and limits.
            clock: of all waiting.
        """
        self._recorder, self._wake, self._new_tracker = recorder, wake, new_tracker
        self._timings, self._clock = timings, clock

    def film(self, canceled: threading.Event, tell: Callable[[FilmingState], None]) -> FilmedStills:
        """Film until all that is asked for is shown, or was asked for long enough.

        Args:
            canceled: ends it when it is set.
            tell: hears how far it is.

        Raises:
            CaptureError: no face is seen, it is too small or too dark, or does too little; or it was canceled.
            DeviceError: the webcam gives no frames.
            ModelError: the networks are not there.
        """
        from relit_camera.app.captures.expression_capture import frames_for_stills
        from relit_camera.capture.expressions.film_tracking import FaceCollection
        from relit_camera.capture.expressions.live_prompts import NEUTRAL, PROMPTS, LiveCoverage, PromptSequence
        from relit_camera.capture.expressions.still_crops import black_beyond_face
        from relit_camera.capture.expressions.still_selection import select_stills

        tracker = self._new_tracker()
        faces = FaceCollection(tracker.scheme, CALLED)
        prompts, coverage = PromptSequence(), LiveCoverage(faces)
        frames: dict[int, bytes] = {}
        first: Frame | None = None
        seen_at, face_at = 0.0, -UNSEEN_S
        count = 0
        while prompts.name is not None:
            frame = self._next_frame(canceled)
            first = first or frame
            if frame.size != first.size:
                raise CaptureError("the size of the webcam's picture changed", "leave it as it is until the end")
            time_s = frame.captured_at - first.captured_at
            # Frames are left out: the index is that of those looked at.
            told = replace(frame, index=count, time_s=time_s)
            face = faces.add(told, tracker.track(told))
            if face is not None:
                seen_at = face_at = time_s
                kept = black_beyond_face(frame.image, face.landmarks)
                frames[count] = encode_display(kept, ".jpg", self._timings.jpeg_quality)
                coverage.update(face, prompts.name == NEUTRAL)
                prompts.update(time_s, coverage.covered)
            elif time_s - seen_at > self._timings.lost_s:
                raise CaptureError(
                    f"no face is seen in {CALLED}", "sit before it, your whole face in the picture, and begin again"
                )
            count += 1
            say = PROMPTS.get(prompts.name or "", "")
            seen = time_s - face_at < UNSEEN_S
            tell(FilmingState(prompts.name or "", say, seen, coverage.covered, round(prompts.share, 3)))
        film = faces.film()
        selection = select_stills(film)
        needed = frames_for_stills(film, selection)
        return FilmedStills(film, selection, {index: frames[index] for index in sorted(needed)})

    def _next_frame(self, canceled: threading.Event) -> Frame:
        """The next frame of the webcam, not too soon after the one before.

        Raises:
            CaptureError: it was canceled.
            DeviceError: there is none.
        """

        def go_on() -> bool:
            self._wake()
            return not canceled.is_set()

        timings = self._timings
        self._clock.wait(canceled, timings.interval_s)
        frames = self._recorder.record(1, 0.0, timings.frame_timeout_s, go_on, timings.longest_side_px)
        if canceled.is_set():
            raise CaptureError("the capture was canceled", "start it again")
        if not frames:
            raise DeviceError("the webcam gives no frames", "see the status, or `relit devices`")
        return frames[0]
