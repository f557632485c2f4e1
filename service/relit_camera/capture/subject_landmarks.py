"""Landmarks of a new subject: found by trackers in its neutral picture, or read from a JSON file.

They are stored in the subject, so that the face need not be found at every start. The file is
{scheme: [[x, y], …]} in pixels, pixel centers at integers + ½.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, TypeAdapter

from relit_camera.base.errors import LightsError, ModelError
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker, track_still

log = logging.getLogger(__name__)

LANDMARK_TRACKERS = ("mesh", "openseeface")
MAX_BYTES = 16 << 20
"""Of a landmarks file."""

_Pixel = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
_Layout = TypeAdapter(dict[str, list[tuple[_Pixel, _Pixel]]])


def find_landmarks(neutral: DisplayImage) -> Mapping[str, Points]:
    """Landmarks (count, 2) of the face in a neutral picture, by scheme of each installed tracker."""
    found: dict[str, Points] = {}
    for name in LANDMARK_TRACKERS:
        try:
            tracker = open_tracker(name, TrackerOptions(blendshapes=False))
        except ModelError as error:
            log.info("landmarks of tracker %s are left out: %s", name, error)
            continue
        state = track_still(neutral, tracker)
        if state.visible:
            found[state.scheme] = state.landmarks
    return found


def read_landmarks(path: Path, required: bool) -> Mapping[str, Points]:
    """Landmarks (count, 2) float32 by scheme; empty if the file is not there and not `required`.

    Raises:
        LightsError: required and missing, not in the layout, or not as many points as the scheme has.
        NotFoundError: an unknown scheme.
    """
    if not path.is_file() and not required:
        return {}
    try:
        if path.stat().st_size > MAX_BYTES:
            raise ValueError(f"it is larger than {MAX_BYTES >> 20} MiB")
        listed = _Layout.validate_json(path.read_bytes())
    except (OSError, ValueError) as error:
        cure = "it must be JSON {scheme: [[x, y], …]}"
        raise LightsError(f"{path} holds no landmarks: {str(error).splitlines()[0]}", cure) from error
    for scheme, points in listed.items():
        if len(points) != (count := landmark_scheme(scheme).count):
            cure = "write all of the scheme's points, in its order"
            raise LightsError(f"{path} holds {len(points)} points of {scheme}, which has {count}", cure)
    return {scheme: np.array(points, dtype=np.float32) for scheme, points in listed.items()}
