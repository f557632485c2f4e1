"""Threads that carry their names to the operating system, so that from outside their processor time is told by name.

Python 3.14 does it by itself. Linux only.
"""

from __future__ import annotations

import threading
from contextlib import suppress
from pathlib import Path


def name_threads() -> None:
    """Give every Python thread that starts from now on its name in the operating system, cut to 15 characters."""
    run_thread = threading.Thread.run

    def run_named(self: threading.Thread) -> None:
        with suppress(OSError):  # no Linux
            Path(f"/proc/self/task/{threading.get_native_id()}/comm").write_text(self.name[:15])
        run_thread(self)

    threading.Thread.run = run_named  # type: ignore[method-assign]
