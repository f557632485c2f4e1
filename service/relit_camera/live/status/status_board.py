"""What the camera says of itself: its state, the tracking and what is degraded. Each change becomes an event."""

from __future__ import annotations

import logging
import threading

from relit_camera.base.errors import RelitError
from relit_camera.base.plugin_groups import package_at_fault
from relit_camera.face.face_state import FaceStatus
from relit_camera.live.status.camera_status import CameraState, Degradation, DegradationCode
from relit_camera.live.status.event_hub import EventHub

log = logging.getLogger(__name__)

OWN_FAULT_CURE = "this is a fault of ours: report it"

PARTS = {
    DegradationCode.SOURCE_FAILED: "source",
    DegradationCode.PICTURE_FAILED: "picture",
    DegradationCode.SINK_FAILED: "sink",
    DegradationCode.KEEPER_FAILED: "keeper",
    DegradationCode.MODELS_MISSING: "tracker",
    DegradationCode.CONFIGURATION_FAILED: "configuration",
}
"""The part of the camera that each code is about, as events and messages name it."""


class StatusBoard:
    """The state, the face's status and the degradations. Any thread may read and change them.

    Attributes:
        events: where every change is published.
    """

    def __init__(self, events: EventHub) -> None:
        self.events = events
        self._state = CameraState.STARTING
        self._face = FaceStatus.LOST
        self._degradations: dict[DegradationCode, Degradation] = {}
        self._lock = threading.Lock()

    @property
    def state(self) -> CameraState:
        """What is being published."""
        return self._state

    @property
    def face(self) -> FaceStatus:
        """Whether the face is tracked."""
        return self._face

    def degradations(self) -> list[Degradation]:
        """What works less well than asked, the oldest first."""
        with self._lock:
            return list(self._degradations.values())

    def is_degraded(self, code: DegradationCode) -> bool:
        """Whether this was reported, and no recovery since."""
        return code in self._degradations

    def set_state(self, state: CameraState) -> None:
        """Change the state. Nothing follows `STOPPING`: a frame finished after that does not make the camera live."""
        with self._lock:
            if state is not self._state and self._state is not CameraState.STOPPING:
                self._state = state
                self.events.publish("state", state=str(state))

    def set_face(self, face: FaceStatus) -> None:
        """Change the face's status."""
        with self._lock:
            if face is not self._face:
                self._face = face
                self.events.publish("tracking", state=str(face))

    def report(self, code: DegradationCode, error: Exception | None) -> None:
        """Say that a part of the camera fails, or with None that it works again.

        Args:
            code: one of `PARTS`.
            error: why. One that is no `RelitError` is a fault in the program or in a plug-in, and is logged with its
                traceback.
        """
        degradation = None if error is None else _degradation(code, error)
        with self._lock:
            if degradation is None:
                if self._degradations.pop(code, None) is not None:
                    self.events.publish("recovered", what=PARTS[code], code=str(code))
                return
            if self._degradations.get(code) == degradation:
                return
            self._degradations[code] = degradation
            self.events.publish(
                "degraded", what=degradation.what, why=degradation.why, cure=degradation.cure, code=str(code)
            )
        # Not under the lock: a terminal or journal that does not take the line must not stop status and shutdown.
        log.error(
            "%s: %s", degradation.what, degradation.why, exc_info=None if isinstance(error, RelitError) else error
        )


def _degradation(code: DegradationCode, error: Exception) -> Degradation:
    what = f"{PARTS[code]} failed"
    if isinstance(error, RelitError):
        return Degradation(code=code, what=what, why=error.what, cure=error.cure)
    package = package_at_fault(error)
    cure = f"this is a fault of the plug-in package {package}: tell its author" if package else OWN_FAULT_CURE
    return Degradation(code=code, what=what, why=f"{type(error).__name__}: {error}", cure=cure)
