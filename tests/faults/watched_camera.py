"""A small running camera whose every published frame is timed, for injecting faults."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from relit_camera.base.images.image_types import DisplayImage
from tests.lateness import Lateness
from tests.small_camera import Camera, RememberingSink, running_camera, wait_until

LONGEST_GAP_S = 1.0
"""Between two published frames, whatever happens, but for what a busy machine makes any thread wait. Chromium gives a
camera up after some ten seconds."""
STOP_S = 1.0
"""`CameraTimings.stop_timeout_s` in these tests."""
MOST_STOP_S = 3.0
"""Within which a camera has stopped whose parts hang, but for what a busy machine makes any thread wait."""
HANG_S = 300.0
"""How long what hangs does so, unless it is released: longer than any test waits."""


@dataclass
class TimedSink(RememberingSink):
    """Keeps the monotonic time of every write."""

    times: list[float] = field(default_factory=list)

    def write(self, image: DisplayImage) -> None:
        super().write(image)
        self.times.append(time.monotonic())


@dataclass
class Watched:
    """A camera under test.

    Attributes:
        camera: it.
        sink: what it publishes to.
        lateness: what the machine makes any thread wait meanwhile.
        since: when the fault began.
    """

    camera: Camera
    sink: TimedSink
    lateness: Lateness
    since: float = 0.0

    def begin(self) -> None:
        """The fault begins now."""
        self.since = time.monotonic()

    def longest_gap_s(self) -> float:
        """Between two writes since the fault began, the last one and now included, but for what any thread waited."""
        times = [self.since, *(each for each in self.sink.times if each > self.since), time.monotonic()]
        return self.lateness.longest_gap_s(times)

    def reports(self, text: str) -> None:
        """Wait until the status reports this."""
        wait_until(lambda: text in self.camera.troubles())

    def hangs(self, stage: str) -> None:
        """Wait until a hang is reported while the pipeline is at a stage."""
        supervisor = self.camera.camera_service._supervisor

        def hangs_there() -> bool:
            pipeline = supervisor.pipeline
            return pipeline is not None and stage in pipeline.timer.running()

        wait_until(lambda: "for some seconds (in: " in self.camera.troubles() and hangs_there())

    def reports_nothing(self) -> bool:
        """Whether the status reports no trouble."""
        return self.camera.troubles() == ""

    def state(self, state: str) -> None:
        """Wait for a state."""
        wait_until(lambda: self.camera.status()["state"] == state)

    def recovers(self) -> None:
        """Wait until all is well: live, with no trouble left, and a new picture shown."""
        wait_until(lambda: self.camera.troubles() == "" and self.camera.status()["state"] == "live")
        self.sink.wait_for(len(self.sink.new) + 1)

    def goes_on(self, frames: int = 5) -> None:
        """Wait for some more frames."""
        count = self.sink.count
        wait_until(lambda: self.sink.count >= count + frames)


Survived = Callable[[str, Watched], None]
"""Called at a fault's end with its name: asserts that no frame was missing for long, and notes it for the table."""


@contextmanager
def watched_camera(folder: Path, **arguments: Any) -> Iterator[Watched]:
    """A running camera that is live; see `running_camera`."""
    sink = TimedSink()
    with Lateness() as lateness, running_camera(folder, sink=sink, **arguments) as camera:
        watched = Watched(camera, sink, lateness)
        watched.state("live")
        sink.wait_for(len(sink.new) + 1)  # the state is live once a picture is on its way; before it is the placeholder
        watched.begin()
        yield watched
