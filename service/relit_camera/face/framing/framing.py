"""How well a person sits before the webcam, for a capture or a call: what is judged, and its answers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class FaceCount(StrEnum):
    """How many faces are in the picture."""

    NONE = "none"
    ONE = "one"
    SEVERAL = "several"


class FramingState(StrEnum):
    """What is found of one thing that matters."""

    GOOD = "good"
    UNKNOWN = "unknown"
    """There is no face to judge it by."""
    NEAR = "near"
    FAR = "far"
    OFF_CENTER = "off-center"
    """The face is cut off, or near an edge."""
    ONE_SIDED = "one-sided"
    """One side of the face is much brighter than the other."""
    BACKLIT = "backlit"
    """What is behind is much brighter than the face."""
    BLURRED = "blurred"
    DARK = "dark"
    BRIGHT = "bright"
    """Parts of the face are white: nothing can be measured there."""


@dataclass(frozen=True)
class FramingItem:
    """One thing that matters, and what to do about it."""

    state: FramingState
    advice: str = ""
    """One sentence; empty where it is good."""


@dataclass(frozen=True)
class Framing:
    """How well the person sits before the webcam."""

    face: FaceCount
    advice: str
    """The one sentence that matters most now; empty where all is good."""
    distance: FramingItem
    position: FramingItem
    light: FramingItem
    sharpness: FramingItem
    exposure: FramingItem
    box: tuple[float, float, float, float] | None = None
    """Left, top, width and height of the largest face, in parts of the frame's width and height, not mirrored."""

    @property
    def is_good(self) -> bool:
        """Whether nothing is to be done."""
        return not self.advice
