"""What a job beside the camera tells those who listen."""

from __future__ import annotations

import queue

from relit_camera.live.status.event_hub import Event
from tests.small_camera import WAIT_S


def stages_until(last: str, events: queue.Queue[Event], kind: str) -> list[str]:
    """The stages that events of a kind tell until `last` is told: the job's status has changed before that.

    Raises:
        queue.Empty: nothing was told for a minute.
    """
    told: list[str] = []
    while last not in told:
        event = events.get(timeout=WAIT_S)
        if event.kind == kind:
            told.append(str(event.data["stage"]))
    return told
