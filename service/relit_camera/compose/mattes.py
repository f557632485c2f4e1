"""Mattes by name: what finds the person in a live frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from relit_camera.compose.matte import PersonMatte
from relit_camera.compose.recorded_matte import RecordedMatte
from relit_camera.errors import NotFoundError
from relit_camera.models.session import SessionOptions
from relit_camera.space.images import Frame, Mask


class Matte(Protocol):
    """Finds the person in frame after frame of one source. Not thread-safe: one a worker."""

    def matte(self, frame: Frame) -> Mask:
        """Alpha of the person, float32 (height, width) of the frame in 0..1, straight.

        Raises:
            ModelError: a network is missing or unusable.
        """
        ...


def find_matte(name: str, options: SessionOptions) -> Callable[[], Matte]:
    """What opens the matte `selfie` (networks, found when they are first needed) or `recorded:FILE` (read at once).

    Raises:
        NotFoundError: no such matte.
        InputError: `recorded:FILE` names no recorded mattes.
    """
    plain, _, argument = name.partition(":")
    if name == "selfie":
        return lambda: PersonMatte(options)
    if plain == "recorded" and argument:
        recorded = RecordedMatte(Path(argument))
        return lambda: recorded
    raise NotFoundError(f"no matte is called '{name}'", "use selfie, or recorded:FILE.npz")
