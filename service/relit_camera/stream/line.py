"""The picture path in threads of its own: what hangs in it can be left behind, and what fails is tried again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait

from relit_camera.errors import RelitError
from relit_camera.space.images import Frame
from relit_camera.stream.pipeline import Finish, Finished, Pipeline
from relit_camera.stream.scene import Scene
from relit_camera.stream.slot import Slot

RETRY_S = 1.0
"""Pause after a frame that could not be processed; it doubles with each one in a row."""
MOST_DOUBLINGS = 4
STUCK_S = 2.0
"""A frame that takes longer hangs: something else is shown meanwhile."""
GIVE_UP_S = 10.0
"""One that takes so long is left behind, and another line begun. Twice as long with each in a row, as the pauses."""
FIRST_FRAME_TIMES = 6
"""A line's first frame may take so many times as long: models are opened for it."""
MOST_LEFT_BEHIND = 3
"""Lines that hang hold memory: with so many, no other is begun before one of them ends."""
FAULTS_TO_RENEW = 3
"""After so many faults of ours in a row the state of the line itself is suspected: it is begun anew."""

_POLL_S = 0.2


class PictureHangsError(RelitError):
    """The picture path gives nothing."""


class Line:
    """One pipeline at work. Frames are handed over by `offer`; pictures and errors come from its threads.

    One frame is finished while the next is begun, no more.
    """

    def __init__(
        self,
        make: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        on_done: Callable[[Frame, Finished], None],
        on_error: Callable[[Exception], None],
    ) -> None:
        """Begin; `make` is called in the line's own thread, for it may open models."""
        self.pipeline: Pipeline | None = None
        self._make, self._scene, self._on_done, self._on_error = make, scene, on_done, on_error
        self.pictures = 0
        self._frames: Slot[Frame] = Slot()
        self._newest = self._frames.reader()
        self._closing = threading.Event()
        self._began_at: float | None = None
        self._finisher = ThreadPoolExecutor(1, "finisher")
        self._finishing: Future[None] = Future()
        self._finishing.set_result(None)
        # A daemon thread: what hangs must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, name="line", daemon=True)
        self._thread.start()

    def offer(self, frame: Frame) -> None:
        """Hand a frame over. It is taken when the one before has been begun, unless a newer one has come by then."""
        self._frames.put(frame)

    @property
    def busy_s(self) -> float:
        """Seconds since the frame in hand was taken; 0 while there is none."""
        began_at = self._began_at
        return 0.0 if began_at is None else time.monotonic() - began_at

    @property
    def dropped(self) -> int:
        """Frames that were replaced by newer ones before they were taken."""
        return self._newest.dropped

    @property
    def stages(self) -> str:
        """The stages that it is in, for people."""
        return ", ".join(self.pipeline.timer.running()) if self.pipeline else "opening models"

    def close(self) -> None:
        """Let it end when it can. Nothing comes from it any more; a frame that hangs is left to itself."""
        self._closing.set()
        self._frames.close()

    def ended(self, timeout_s: float = 0.0) -> bool:
        """Whether its threads have ended, waiting up to `timeout_s` for it. Only after `close`."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while not self._closing.is_set():
            frame = self._newest.get(_POLL_S)
            if frame is not None:
                self._began_at = time.monotonic()
                try:
                    self._work(frame)
                finally:
                    self._began_at = None
        self._finisher.shutdown()

    def _work(self, frame: Frame) -> None:
        try:
            if self.pipeline is None:
                self.pipeline = self._make()
            finish = self.pipeline.begin(frame, self._scene)
        except Exception as error:  # nothing that one frame does may end the camera
            self._failed(error)
            return
        wait([self._finishing])
        if not self._closing.is_set():
            self._finishing = self._finisher.submit(self._finish, frame, finish)

    def _finish(self, frame: Frame, finish: Finish) -> None:
        try:
            finished = finish()
            if not self._closing.is_set():
                self.pictures += 1
                self._on_done(frame, finished)
        except Exception as error:
            self._failed(error)

    def _failed(self, error: Exception) -> None:
        if not self._closing.is_set():
            self._on_error(error)


class LineKeeper:
    """Keeps a line at work. Used by one thread; told of pictures and errors by the line's.

    After an error the line gets no frames for a while, or until the scene is another. One that hangs is closed, left
    behind, and another begun, with a new pipeline; so is one in which faults of ours come one after the other.
    """

    def __init__(
        self,
        first: Pipeline,
        make: Callable[[], Pipeline],
        scene: Callable[[], Scene],
        on_done: Callable[[Frame, Finished], None],
        on_trouble: Callable[[Exception | None], None],
    ) -> None:
        """Set up; the first frame begins.

        Args:
            first: the pipeline to begin with.
            make: makes another.
            scene: the scene that counts now.
            on_done: gets each frame and its picture, in the line's thread.
            on_trouble: gets each error, and None when a picture came after one.
        """
        self.pipeline = first
        """The one at work."""
        self._next: Callable[[], Pipeline] = lambda: first
        self._make, self._scene, self._on_done, self._on_trouble = make, scene, on_done, on_trouble
        self._line: Line | None = None
        self._left: list[Line] = []
        self._dropped_before = 0
        self._errors = self._hung = 0
        self._told_hanging = self._suspect = False
        self._retry_at = 0.0
        self._failed_scene: Scene | None = None

    @property
    def dropped(self) -> int:
        """Frames that no line took."""
        return self._dropped_before + (self._line.dropped if self._line else 0)

    def offer(self, frame: Frame) -> bool:
        """Hand a frame to the line. Returns whether its picture can be expected: if not, something must stand in."""
        self._left = [line for line in self._left if not line.ended()]
        line = self._line or self._renewed()
        if line is None:
            return False
        self.pipeline = line.pipeline or self.pipeline
        if line.busy_s > STUCK_S:
            self._hangs(line)
            return False
        if self._errors and time.monotonic() < self._retry_at and self._scene() is self._failed_scene:
            return False
        if self._suspect:
            self._suspect = False
            self._retire(line)
            return False
        line.offer(frame)
        return not (self._errors or self._told_hanging)

    def close(self) -> None:
        """Let all lines end; see `ended`."""
        for line in self._lines():
            line.close()

    def ended(self, by: float) -> bool:
        """Whether all have ended, waiting until the monotonic time `by` for it. Only after `close`."""
        return all(line.ended(max(0.0, by - time.monotonic())) for line in self._lines())

    def _lines(self) -> list[Line]:
        return [*self._left, *([self._line] if self._line else [])]

    def _done(self, frame: Frame, finished: Finished) -> None:
        if self._errors or self._told_hanging:
            self._errors = self._hung = 0
            self._told_hanging = self._suspect = False
            self._on_trouble(None)
        self._on_done(frame, finished)

    def _failed(self, error: Exception) -> None:
        self._retry_at = time.monotonic() + RETRY_S * 2 ** min(self._errors, MOST_DOUBLINGS)
        self._failed_scene = self._scene()
        self._errors += 1
        self._suspect = not isinstance(error, RelitError) and self._errors % FAULTS_TO_RENEW == 0
        self._on_trouble(error)

    def _hangs(self, line: Line) -> None:
        starts = line.pictures == 0
        if not self._told_hanging and (not starts or line.busy_s > GIVE_UP_S):
            self._told_hanging = True
            self._on_trouble(
                PictureHangsError(
                    f"it has given no picture for some seconds (in: {line.stages})",
                    "a still stands in, and it is begun anew by itself; if that does not help, restart the camera",
                )
            )
        if line.busy_s > GIVE_UP_S * 2 ** min(self._hung, MOST_DOUBLINGS) * (FIRST_FRAME_TIMES if starts else 1):
            self._hung += 1
            self._retire(line)

    def _retire(self, line: Line) -> None:
        line.close()
        self._left.append(line)
        self._dropped_before += line.dropped
        self._line = None

    def _renewed(self) -> Line | None:
        if len(self._left) < MOST_LEFT_BEHIND:
            self._line = Line(self._next, self._scene, self._done, self._failed)
            self._next = self._make
        return self._line
