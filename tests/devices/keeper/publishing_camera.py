"""A camera of its own process for tests: publishes pictures of one grey through a keeper until it is killed.

publishing_camera.py FOLDER GREY VERSION WIDTH KEEP_S: a line of input makes it leave; `hand-over` makes it hand over.
"""

from __future__ import annotations

import select
import sys
import time
from pathlib import Path

import numpy as np

from relit_camera.base.errors import RelitError
from relit_camera.devices.keeper.kept_output import OutputOptions
from relit_camera.devices.keeper.kept_sink import KeeperParts, KeptSink
from relit_camera.devices.keeper.sink_keeper import SinkKeeper
from relit_camera.devices.sinks.sink import NullSink
from tests.devices.keeper.stand_in_sink import FPS, OPENER, PLACEHOLDER


def main() -> None:
    folder, grey, version, width = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3], int(sys.argv[4])
    size = width, width // 2
    options = OutputOptions(size, FPS, "Relit Camera", sink=OPENER)
    keeper = SinkKeeper(options, float(sys.argv[5]), folder, *([version] if version else []))
    parts = KeeperParts(lambda size: np.full((size[1], size[0], 3), PLACEHOLDER, np.uint8))
    try:
        sink = KeptSink(keeper, parts, lambda: NullSink(size))
    except RelitError as error:
        sys.exit(str(error))
    print(f"ready {keeper.trouble or ''}", flush=True)
    due = time.monotonic()
    while not select.select([sys.stdin], [], [], max(0.0, due - time.monotonic()))[0]:
        sink.write(np.full((size[1], size[0], 3), grey, np.uint8))
        due += 1 / FPS
    keeper.hands_over = sys.stdin.readline().strip() == "hand-over"
    sink.close()


if __name__ == "__main__":
    main()
