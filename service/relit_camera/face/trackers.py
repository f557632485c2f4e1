"""Trackers by name.

A plug-in is an entry point of the group `relit_camera.trackers`: called with `TrackerOptions`, it gives a
`face.state.Tracker`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from typing import cast

from relit_camera.errors import InputError, NotFoundError
from relit_camera.face.state import Tracker
from relit_camera.models.session import SessionOptions

GROUP = "relit_camera.trackers"


@dataclass(frozen=True)
class TrackerOptions:
    """What every tracker is opened with.

    Attributes:
        argument: what follows the colon in `NAME:ARGUMENT`, such as the path in `recorded:T.json`.
        session: how to run its networks.
        focal_px: focal length of the camera in pixels; None guesses the picture's longer side.
        blendshapes: whether to score blendshapes too, where the tracker can.
        check_every: frames between two checks of the landmarks against the detector.
    """

    argument: str = ""
    session: SessionOptions = field(default_factory=SessionOptions)
    focal_px: float | None = None
    blendshapes: bool = True
    check_every: int = 10

    def no_argument(self, tracker: str) -> None:
        """For trackers that take none.

        Raises:
            InputError: there is an argument.
        """
        if self.argument:
            raise InputError(f"tracker {tracker} takes no argument, and got '{self.argument}'", f"name it '{tracker}'")


def tracker_names() -> list[str]:
    """List the names of all installed trackers, sorted."""
    return sorted(entry_points(group=GROUP).names)


def open_tracker(name: str, options: TrackerOptions | None = None) -> Tracker:
    """Open the tracker `NAME` or `NAME:ARGUMENT`.

    Raises:
        NotFoundError: no tracker of that name is installed.
        ModelError: its models are not there; `relit models pull` gets them.
        TrackError: `recorded:PATH` names no usable track file.
    """
    plain, _, argument = name.partition(":")
    points = entry_points(group=GROUP, name=plain)
    if not points:
        raise NotFoundError(f"no tracker is called '{plain}'", f"use one of {', '.join(tracker_names())}")
    factory = cast(Callable[[TrackerOptions], Tracker], next(iter(points)).load())
    return factory(replace(options or TrackerOptions(), argument=argument))
