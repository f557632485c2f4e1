"""Sources whose pictures and times are known: a file, a still, a pattern. Played in real time, or as fast as read."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from relit_camera.space.images import DisplayImage, Frame
from relit_camera.stream.sources.base import Source, SourceInfo, SourceState, StateMachine
from relit_camera.stream.sources.threaded import ThreadedSource

Timed = tuple[DisplayImage, float]
"""A picture and its time in seconds from the first one."""

Play = Callable[[], Iterator[Timed]]
"""Begins to play from the first picture."""

LATE_S = 0.5


def playback(info: SourceInfo, play: Play, *, loop: bool, realtime: bool) -> Source:
    """Make a source of these pictures.

    Args:
        info: what `describe` answers.
        play: gives the pictures; called again for each round.
        loop: begin anew after the last picture; indices and times go on.
        realtime: give each picture when it is due, dropping those that nobody came for. Otherwise give every picture
            as soon as it is asked for.
    """
    return PacedPlayback(info, play, loop=loop) if realtime else Playback(info, play, loop=loop)


def _rounds(info: SourceInfo, play: Play, loop: bool) -> Iterator[Timed]:
    """All pictures of all rounds, their times growing throughout."""
    start = 0.0
    while True:
        end = start
        for image, time_s in play():
            end = start + time_s
            yield image, end
        if not loop:
            return
        start = end + 1 / info.fps


class Playback:
    """Gives every picture, at the reader's pace."""

    def __init__(self, info: SourceInfo, play: Play, *, loop: bool = False) -> None:
        self._info = info
        self._machine = StateMachine()
        self._pictures = enumerate(_rounds(info, play, loop))
        self._error: Exception | None = None

    def read(self, timeout_s: float) -> Frame | None:
        """Get the next frame, or None after the last; the time limit is not needed.

        Raises:
            RelitError: the pictures cannot be read any further.
        """
        if self._error is not None:
            raise self._error
        if self.state is SourceState.ENDED:
            return None
        self._machine.move(SourceState.OPENING, only_from=SourceState.IDLE)
        try:
            index, (image, time_s) = next(self._pictures)
        except StopIteration:
            self._machine.move(SourceState.ENDED)
            return None
        except Exception as error:
            self._error = error
            self._machine.move(SourceState.FAILED)
            raise
        self._machine.move(SourceState.RUNNING)
        return Frame(image, index, time.monotonic(), time_s)

    @property
    def state(self) -> SourceState:
        """What the source is doing."""
        return self._machine.state

    @property
    def reason(self) -> str:
        """One line saying why no frames come; empty while they do."""
        return str(self._error or "")

    def describe(self) -> SourceInfo:
        """Say what the source is."""
        return self._info

    def close(self) -> None:
        """Give no more frames."""
        self._machine.move(SourceState.ENDED)
        self._pictures = enumerate(iter(()))


class PacedPlayback(ThreadedSource):
    """Gives each picture when it is due, counted from the first `read`."""

    def __init__(self, info: SourceInfo, play: Play, *, loop: bool = False) -> None:
        super().__init__(info)
        self._pictures = enumerate(_rounds(info, play, loop))

    def _produce(self) -> None:
        start = time.monotonic()
        for index, (image, time_s) in self._pictures:
            late_s = time.monotonic() - (start + time_s)
            if late_s > LATE_S:  # suspended, or decoding is too slow: go on from here instead of rushing through
                start += late_s
            elif self._stopping.wait(max(0.0, -late_s)):
                return
            if self._stopping.is_set():
                return
            self._publish(Frame(image, index, time.monotonic(), time_s))
