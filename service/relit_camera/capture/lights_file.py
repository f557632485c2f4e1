"""RTI light files (.lp): the count in the first line, then lines `file x y z` with unit vectors toward the lights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import LightsError

LIGHTS_FILE_NAME = "lights.lp"
"""What a list of lights is called in a folder of pictures."""
NORM_TOLERANCE = 0.01
"""Largest deviation of a direction's length from 1."""
MIN_LIGHTS = 4
MAX_BYTES = 4 << 20
"""Of an .lp file."""


@dataclass(frozen=True)
class LightPicture:
    """One line of an .lp file: a picture and the direction (3,) float64, of unit length, toward its light."""

    path: Path
    direction: NDArray[np.float64]


def read_lights(path: Path) -> list[LightPicture]:
    """Read an .lp file; file names may hold spaces, and are relative to the .lp or absolute.

    Raises:
        LightsError: not an .lp file, a wrong count, a missing picture, a direction that is not a unit vector.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise LightsError(f"{path} is larger than {MAX_BYTES >> 20} MiB", "is it an .lp file?")
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = "not a text file" if isinstance(error, UnicodeDecodeError) else error.strerror
        raise LightsError(
            f"cannot read {path}: {reason}", "name an .lp file: a count, then 'file x y z' lines"
        ) from error
    rows = [(number, line.strip()) for number, line in enumerate(lines, 1) if line.strip()]
    if not rows or not rows[0][1].isdecimal():
        first = rows[0][1][:40] if rows else ""
        raise LightsError(f"{path} line 1: expected the count of lights, found '{first}'", "is it an .lp file?")
    count = int(rows[0][1])
    if count != len(rows) - 1:
        raise LightsError(f"{path} announces {count} lights and lists {len(rows) - 1}", "correct the first line")
    if count < MIN_LIGHTS:
        raise LightsError(f"{path} lists {count} lights", f"at least {MIN_LIGHTS} are needed, forty or more are good")
    return [_light(path, number, line) for number, line in rows[1:]]


def _light(path: Path, number: int, line: str) -> LightPicture:
    parts = line.rsplit(maxsplit=3)
    try:
        direction = np.array([float(value) for value in parts[1:]])
    except ValueError:
        direction = np.empty(0)
    if len(parts) != 4 or direction.shape != (3,) or not np.isfinite(direction).all():
        raise LightsError(f"{path} line {number}: expected 'file x y z', found '{line[:60]}'", "correct the line")
    norm = float(np.linalg.norm(direction))
    if abs(norm - 1) > NORM_TOLERANCE:
        raise LightsError(
            f"{path} line {number}: the direction of {parts[0]} has length {norm:.4g}, not 1",
            "give unit vectors toward the light",
        )
    picture = path.parent / parts[0]
    try:
        is_there = picture.is_file()
    except OSError:  # no file can have such a name
        is_there = False
    if not is_there:
        raise LightsError(
            f"{path} line {number}: no picture at {str(picture)[:300]}", "correct the name or bring the file"
        )
    return LightPicture(picture, direction / norm)
