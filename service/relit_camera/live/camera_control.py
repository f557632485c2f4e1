"""The interface through which the API controls the running camera."""

from __future__ import annotations

from typing import Protocol

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import CameraStatus
from relit_camera.live.status.capture_status import CaptureStatus
from relit_camera.live.status.desk_status import DeskCaptureStatus, DeskPlace
from relit_camera.live.status.event_hub import EventHub


class CaptureControl(Protocol):
    """A capture that runs beside the camera. `app.live_capture.LiveCapture` implements it."""

    def status(self) -> CaptureStatus:
        """How far the last capture is."""
        ...

    def start(self, name: str) -> CaptureStatus:
        """Begin to capture a subject that is stored under `name`, and shown once it is.

        Raises:
            ConflictError: a capture runs, or a better subject has that name.
            InputError: the name is not allowed.
        """
        ...

    def cancel(self) -> CaptureStatus:
        """End the capture that runs, if one does; nothing is stored then."""
        ...


class DeskCaptureControl(Protocol):
    """A desk capture, whose patterns a page shows. `app.desk.desk_filming.DeskFilming` implements it."""

    def status(self) -> DeskCaptureStatus:
        """How far the last capture is."""
        ...

    def start(self, name: str, place: DeskPlace) -> DeskCaptureStatus:
        """Begin to capture a subject that is stored under `name`, and shown once it is.

        Raises:
            ConflictError: a capture runs, or a better subject has that name.
            InputError: the name is not allowed, or the place cannot be.
        """
        ...

    def page_shows(self, step: int) -> DeskCaptureStatus:
        """Note which step the page shows; it must be called several times a second."""
        ...

    def cancel(self) -> DeskCaptureStatus:
        """End the capture that runs, if one does; nothing is stored then."""
        ...


class CameraControl(Protocol):
    """The running camera as the API sees it. `app.camera_service.CameraService` implements it."""

    scene_controller: SceneController
    events: EventHub

    @property
    def instant_capture(self) -> CaptureControl:
        """The capture that makes a subject of the person before the camera."""
        ...

    @property
    def desk_capture(self) -> DeskCaptureControl:
        """The capture by the light of the person's own screen."""
        ...

    def status(self) -> CameraStatus:
        """The camera's present state; cheap enough for several calls a second."""
        ...

    def picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """The newest published picture and its count if that is above `after`, waiting up to `timeout_s` for one.

        The picture is uint8 sRGB RGB (height, width, 3), not mirrored. None when time is up or the camera stops.
        """
        ...

    def reset_neutral_pose(self) -> None:
        """Take the present head pose as neutral, from the next frame in which the face is found."""
        ...

    def stopping(self) -> bool:
        """Whether the camera is shutting down: long answers must end."""
        ...
