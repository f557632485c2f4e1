"""Known landmarks beside a set of one-light pictures: JSON {scheme: [[x, y], …]}, pixels, centres at integers + ½."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from relit_camera.errors import LightsError
from relit_camera.face.schemes import landmark_scheme
from relit_camera.space.images import Points

MAX_BYTES = 16 << 20

_Layout = TypeAdapter(dict[str, list[tuple[float, float]]])


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
