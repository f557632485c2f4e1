"""Performances: what a person does at each time of a driving video."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relit_studio.people.posture import Posture
from relit_studio.people.props.held_objects import Gesture

FPS = 24


@dataclass(frozen=True)
class ActorState:
    """State of the person at one time.

    Attributes:
        posture: of the head and the face.
        shift_cm: how far the whole person has moved from their place: right in the picture, up, toward the camera.
        gesture: of the hands; None in performances without visible hands.
    """

    posture: Posture = field(default_factory=Posture)
    shift_cm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gesture: Gesture | None = None


@dataclass(frozen=True)
class Performance:
    """A person's postures, gestures and place over the time of a driving video.

    Attributes:
        name: of the performance.
        frames: at 24 a second.
        state_at: state of the person at a time in seconds.
        summary: in a few words.
    """

    name: str
    frames: int
    state_at: Callable[[float], ActorState]
    summary: str

    @property
    def handles(self) -> bool:
        """Whether hands are visible in it."""
        return self.state_at(0.0).gesture is not None


def frame_times(frames: int) -> NDArray[np.float64]:
    """Presentation times (frames,) in seconds."""
    return np.arange(frames) / FPS
