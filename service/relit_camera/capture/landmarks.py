"""Finding the face in a new subject's still, so that it need not be found at every start."""

from __future__ import annotations

import logging
from collections.abc import Mapping

from relit_camera.errors import ModelError
from relit_camera.face.still import look_at
from relit_camera.face.trackers import TrackerOptions, open_tracker
from relit_camera.space.images import DisplayImage, Points

log = logging.getLogger(__name__)

TRACKERS = ("mesh", "openseeface")


def find_landmarks(still: DisplayImage) -> Mapping[str, Points]:
    """The face's landmarks (count, 2) in each scheme whose tracker is installed; empty where there is no face."""
    found: dict[str, Points] = {}
    for name in TRACKERS:
        try:
            tracker = open_tracker(name, TrackerOptions(blendshapes=False))
        except ModelError as error:
            log.info("landmarks of tracker %s are left out: %s", name, error)
            continue
        state = look_at(still, tracker)
        if state.visible:
            found[state.scheme] = state.landmarks
    return found
