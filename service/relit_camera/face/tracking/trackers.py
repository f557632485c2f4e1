"""Trackers by name.

A plug-in is an entry point of the group `relit_camera.trackers`: called with `TrackerOptions`, it gives a
`face.face_state.Tracker`.

Looking at a still picture with a tracker that is made for video.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from typing import cast

from relit_camera.base.errors import InputError, NotFoundError
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.face_state import FaceState, Tracker

TRACKER_ENTRY_POINTS = "relit_camera.trackers"


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

    def require_no_argument(self, tracker: str) -> None:
        """For trackers that take none.

        Raises:
            InputError: there is an argument.
        """
        if self.argument:
            raise InputError(f"tracker {tracker} takes no argument, and got '{self.argument}'", f"name it '{tracker}'")


def tracker_names() -> list[str]:
    """List the names of all installed trackers, sorted."""
    return sorted(entry_points(group=TRACKER_ENTRY_POINTS).names)


def open_tracker(name: str, options: TrackerOptions | None = None) -> Tracker:
    """Open the tracker `NAME` or `NAME:ARGUMENT`.

    Raises:
        NotFoundError: no tracker of that name is installed.
        ModelError: its models are not there; `relit models pull` gets them.
        TrackError: `recorded:PATH` names no usable track file.
    """
    plain, _, argument = name.partition(":")
    points = entry_points(group=TRACKER_ENTRY_POINTS, name=plain)
    if not points:
        raise NotFoundError(f"no tracker is called '{plain}'", f"use one of {', '.join(tracker_names())}")
    factory = cast(Callable[[TrackerOptions], Tracker], next(iter(points)).load())
    return factory(replace(options or TrackerOptions(), argument=argument))


STILL_REPEATS = 4
"""A tracker sees the still this many times: it settles as it would on a person sitting still."""


def track_still(still: DisplayImage, tracker: Tracker) -> FaceState:
    """What `tracker` says of a still picture. It forgets what it followed before, and the still afterwards."""
    tracker.reset()
    states = [tracker.track(Frame(still, index, time.monotonic(), index / 30)) for index in range(STILL_REPEATS)]
    tracker.reset()
    return states[-1]
