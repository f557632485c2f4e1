"""The live source: a reader thread that fills a slot."""

from __future__ import annotations

import logging
import threading
from abc import ABC, abstractmethod

from relit_camera.space.images import Frame
from relit_camera.stream.slot import Slot
from relit_camera.stream.sources.base import SourceInfo, SourceState, StateMachine

log = logging.getLogger(__name__)

JOIN_S = 2.0


class ThreadedSource(ABC):
    """A `Source` whose frames are made in a thread of its own, started by the first `read`.

    Subclasses write `_produce`, which calls `_publish` for every frame and returns soon after `_stopping` is set.
    """

    def __init__(self, info: SourceInfo) -> None:
        self._info = info
        self._machine = StateMachine()
        self._stopping = threading.Event()
        self._slot: Slot[Frame] = Slot()
        self._reader = self._slot.reader()
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        self._reason = ""

    def read(self, timeout_s: float) -> Frame | None:
        """Get the newest frame not read yet, waiting up to `timeout_s`; None if none came.

        Raises:
            RelitError: the source has failed for good.
        """
        if self._thread is None and not self._stopping.is_set():
            self._machine.move(SourceState.OPENING)
            # A daemon thread: a driver that never answers must not keep the program from ending.
            self._thread = threading.Thread(target=self._run, name=f"source-{self._info.kind}", daemon=True)
            self._thread.start()
        frame = self._reader.get(timeout_s)
        if frame is None and self._error is not None:
            raise self._error
        return frame

    @property
    def state(self) -> SourceState:
        """What the source is doing."""
        return self._machine.state

    @property
    def reason(self) -> str:
        """One line saying why no frames come; empty while they do."""
        return self._reason

    def describe(self) -> SourceInfo:
        """Say what the source is."""
        return self._info

    def close(self) -> None:
        """End the thread and free what it holds, within 2 s."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)
            if self._thread.is_alive():
                log.warning("%s did not let go of its device within %.0f s", self._thread.name, JOIN_S)
        self._slot.close()
        self._machine.move(SourceState.ENDED)

    def _run(self) -> None:
        try:
            self._produce()
        except Exception as error:  # handed to the thread that reads
            self._error, self._reason = error, str(error)
            self._machine.move(SourceState.FAILED)
        else:
            self._machine.move(SourceState.ENDED)
        finally:
            self._slot.close()

    def _publish(self, frame: Frame) -> None:
        if self._stopping.is_set():
            return
        self._reason = ""
        self._machine.move(SourceState.RUNNING)
        self._slot.put(frame)  # last, so that whoever gets it finds the source running

    @abstractmethod
    def _produce(self) -> None:
        """Make frames until there are no more or `_stopping` is set."""
