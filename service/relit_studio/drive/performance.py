"""What a performance is: what the person does at each time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relit_studio.people.posture import Posture
from relit_studio.props.held import Gesture

FPS = 24


@dataclass(frozen=True)
class Moment:
    """What is so at one time.

    Attributes:
        posture: of the head and the face.
        shift_cm: how far the whole person has moved from their place: right in the picture, up, toward the camera.
        gesture: of the hands; None where they are never seen.
    """

    posture: Posture = field(default_factory=Posture)
    shift_cm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gesture: Gesture | None = None


@dataclass(frozen=True)
class Performance:
    """A performance.

    Attributes:
        name: of the performance.
        frames: at 24 a second.
        moment: what is so at a time in seconds.
        summary: in a few words.
    """

    name: str
    frames: int
    moment: Callable[[float], Moment]
    summary: str

    @property
    def handles(self) -> bool:
        """Whether hands are seen in it."""
        return self.moment(0.0).gesture is not None


def frame_times(frames: int) -> NDArray[np.float64]:
    """Presentation times (frames,) in seconds."""
    return np.arange(frames) / FPS
