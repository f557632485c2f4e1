"""Changes of the scene that need files: these are read while other changes go on, and the lock is held briefly."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NoReturn

from relit_camera.base.concurrency.resident_memory import large_allocations_apart
from relit_camera.base.errors import RelitError
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.subject import Subject


@dataclass
class Loaded:
    """What was loaded for one change, while others could be made.

    Attributes:
        scenes: hold environments and background pictures.
        subjects: by name.
        failed: what cannot be loaded, with the reason.
    """

    scenes: list[Scene] = field(default_factory=list)
    subjects: dict[str, Subject] = field(default_factory=dict)
    failed: list[tuple[object, RelitError]] = field(default_factory=list)

    def require_usable(self, wanted: object) -> None:
        """Raise the error that came while it was loaded, if one did."""
        for other, error in self.failed:
            if other == wanted:
                raise error

    def ask_for(self, wanted: object, load: Callable[[Loaded], object]) -> NoReturn:
        """Break the change off until something is loaded; it is made anew then.

        Args:
            wanted: what, as in `failed`.
            load: loads it into a `Loaded`.
        """
        raise _NotLoadedError(wanted, load)


class _NotLoadedError(Exception):
    """Something must be loaded before the change can be made.

    Attributes:
        wanted: what, as in `Loaded.failed`.
        load: loads it into a `Loaded`.
    """

    def __init__(self, wanted: object, load: Callable[[Loaded], object]) -> None:
        super().__init__()
        self.wanted, self.load = wanted, load


def load_and_change(lock: threading.Lock, change: Callable[[Loaded], Scene]) -> Scene:
    """Make a change under a lock. What it still needs is loaded without it, and the change is made anew then.

    Args:
        lock: held while `change` is called.
        change: gives the scene that it made; it calls `Loaded.ask_for`, before it has changed anything, where
            something must be loaded first. What could not be loaded is in `Loaded.failed` at its next call.

    Raises:
        RelitError: of `change`.
    """
    loaded = Loaded()
    while True:
        try:
            with lock:
                return change(loaded)
        except _NotLoadedError as error:
            missing = error
        try:
            with large_allocations_apart(tidied=False):
                missing.load(loaded)
        except RelitError as error:
            loaded.failed.append((missing.wanted, error))
