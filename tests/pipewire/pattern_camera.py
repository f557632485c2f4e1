"""A camera that shows the numbered test pattern, as a process of its own: `python -m tests.pipewire.pattern_camera`.

On each change, and each second, it prints a line of JSON: the number of the last picture, who reads, whether the webcam
would be wanted, and why pictures are not taken. SIGTERM ends it.
"""

from __future__ import annotations

import argparse
import json
import signal
import threading
import time

import numpy as np

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import DeviceError
from relit_camera.devices.keeper.keeper_process import VERSION
from relit_camera.devices.keeper.kept_sink import KeeperParts, KeptSink, keeper_for
from relit_camera.devices.on_demand.on_demand_source import DemandWatch
from relit_camera.devices.sinks.reopening_sink import ReopeningSink
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sinks.sink_factory import open_sink
from relit_camera.devices.sources.pattern_source import draw_pattern

RETRY_S = 0.2
PLACEHOLDER = 90
"""Grey that a keeper shows where it does not show the last picture."""


def main() -> None:
    """Show it until the process is ended."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sink", default="pipewire")
    parser.add_argument("--width", type=int, default=320)
    parser.add_argument("--height", type=int, default=180)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--keep-s", type=float, default=0.0, help="with a keeper that goes on for so long")
    parser.add_argument("--version", default=VERSION, help="of the program, as the keeper is told")
    given = parser.parse_args()
    settings = OutputSettings(
        sink=given.sink, width=given.width, height=given.height, fps=given.fps, keep_s=given.keep_s
    )
    size = given.width, given.height
    sink = ReopeningSink(lambda: opened(settings, given.version), size)
    demand = DemandWatch(sink)
    told: dict[str, object] = {}
    number, retry_at = 0, 0.0
    ending = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ending.set())
    while not ending.is_set():
        error = None
        if time.monotonic() >= retry_at:
            try:
                sink.write(draw_pattern(size, number))
            except DeviceError as failure:
                error, retry_at = str(failure), time.monotonic() + RETRY_S
            info = sink.describe()
            state: dict[str, object] = {
                "sink": info.name,
                "readers": info.pipewire.count if info.pipewire else None,
                "names": list(info.pipewire.names) if info.pipewire else [],
                "wanted": demand.wanted(),
                "error": error,
            }
            if state != told or number % round(given.fps) == 0:
                told = state
                print(json.dumps({"number": number, **state}), flush=True)
        number += 1
        time.sleep(1 / given.fps)
    sink.close()


def opened(settings: OutputSettings, version: str) -> Sink:
    """The sink, which a keeper holds if the settings say so."""
    keeper = keeper_for(settings, version)
    if keeper is None:
        return open_sink(settings)
    parts = KeeperParts(lambda size: np.full((size[1], size[0], 3), PLACEHOLDER, np.uint8))
    return KeptSink(keeper, parts, lambda: open_sink(settings))


if __name__ == "__main__":
    main()
