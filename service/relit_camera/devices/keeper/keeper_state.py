"""What the keeper shows, and when: a state machine without sockets or clock.

While the camera's pictures come, the keeper hands them on and does nothing of its own. When one is late it shows the
last one again, and goes on so, whether the camera was killed, hangs, or is started anew. `next_step` says what is to be
done at a time, and when to ask again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

LAST_PICTURE_S = 10.0
"""The last picture is repeated for so long; then the placeholder is shown."""
FILMED_S = 0.5
"""The same where a part of it could be as filmed, and the camera hangs: nobody could stop it."""
LATE_PERIODS = 1.5
"""A picture is late when none came for so many periods of the frame rate."""
LONGEST_PERIOD_S = 0.1
"""Of the repetitions, however low the frame rate is."""


@dataclass(frozen=True)
class KeeperLimits:
    """How long the keeper shows something by itself.

    Attributes:
        period_s: of the camera's pictures, in seconds.
        keep_s: without a camera it ends so long after the last picture.
    """

    period_s: float
    keep_s: float

    @property
    def repeat_s(self) -> float:
        """Seconds between two pictures that the keeper shows by itself."""
        return min(self.period_s, LONGEST_PERIOD_S)


@dataclass(frozen=True)
class KeeperState:
    """What the keeper knows.

    Attributes:
        camera_at: when the camera's last picture was shown, in seconds on the clock.
        shown_at: when the last picture was shown, whoever it came from.
        connected: whether a camera is there.
        repeatable: whether the last picture may be repeated without the camera: not where a part of it could be as
            filmed.
    """

    camera_at: float
    shown_at: float
    connected: bool
    repeatable: bool


class KeeperStep(Enum):
    """What the keeper does by itself."""

    WAIT = "wait"
    REPEAT = "repeat"
    """Show the last picture again."""
    PLACEHOLDER = "placeholder"
    END = "end"
    """Close the virtual camera: nobody has come for it."""


def next_step(state: KeeperState, now: float, limits: KeeperLimits) -> tuple[KeeperStep, float]:
    """What is to be done now, and after how many seconds to ask again if nothing comes.

    Args:
        state: what is known.
        now: in seconds on the clock.
        limits: how long the keeper shows something by itself.
    """
    silent_s = now - state.camera_at
    if not state.connected and silent_s >= limits.keep_s:
        return KeeperStep.END, 0.0
    by_itself = state.shown_at > state.camera_at
    due_at = state.shown_at + limits.repeat_s * (1.0 if by_itself else LATE_PERIODS)
    if now < due_at:
        return KeeperStep.WAIT, due_at - now
    repeated_s = LAST_PICTURE_S if state.repeatable else FILMED_S if state.connected else 0.0
    return KeeperStep.REPEAT if silent_s < repeated_s else KeeperStep.PLACEHOLDER, limits.repeat_s
