"""Looking at a still picture with a tracker that is made for video."""

from __future__ import annotations

import time

from relit_camera.face.state import FaceState, Tracker
from relit_camera.space.images import DisplayImage, Frame

LOOKS = 4
"""A tracker sees the still this many times: it settles as it would on a person sitting still."""


def look_at(still: DisplayImage, tracker: Tracker) -> FaceState:
    """What `tracker` says of a still picture. It forgets what it followed before, and the still afterwards."""
    tracker.reset()
    states = [tracker.track(Frame(still, index, time.monotonic(), index / 30)) for index in range(LOOKS)]
    tracker.reset()
    return states[-1]
