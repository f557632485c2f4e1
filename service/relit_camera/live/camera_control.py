"""The interface through which the API controls the running camera."""

from __future__ import annotations

from typing import Protocol

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import CameraStatus
from relit_camera.live.status.event_hub import EventHub


class CameraControl(Protocol):
    """The running camera as the API sees it. `app.camera_service.CameraService` implements it."""

    scene_controller: SceneController
    events: EventHub

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
