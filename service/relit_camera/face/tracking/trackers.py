"""Trackers by name, and tracking a still picture with a tracker that is made for video.

A plug-in is an entry point of the group `relit_camera.trackers`: called with `TrackerOptions`, it gives a
`face.face_state.Tracker`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.face.face_state import FaceState, Tracker


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


TRACKERS: PluginGroup[Callable[[TrackerOptions], Tracker]] = PluginGroup(
    "relit_camera.trackers", "tracker", with_argument=("recorded",)
)


def open_tracker(name: str, options: TrackerOptions | None = None) -> Tracker:
    """Open the tracker `NAME` or `NAME:ARGUMENT`.

    Raises:
        NotFoundError: no tracker of that name is installed.
        ConfigError: the plug-in cannot be loaded.
        ModelError: its models are not there; `relit models pull` gets them.
        TrackError: `recorded:PATH` names no usable track file.
    """
    factory, argument = TRACKERS.load(name)
    return factory(replace(options or TrackerOptions(), argument=argument))


STILL_REPEATS = 4
"""A tracker gets a picture this many times: it settles as it would on a person who sits still."""


def track_still(picture: DisplayImage, tracker: Tracker) -> FaceState:
    """Track the face in a still picture (height, width, 3) uint8. The tracker is reset before and afterwards."""
    tracker.reset()
    states = [tracker.track(Frame(picture, index, time.monotonic(), index / 30)) for index in range(STILL_REPEATS)]
    tracker.reset()
    return states[-1]
