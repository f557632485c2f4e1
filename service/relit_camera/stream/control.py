"""What the API may do with the running camera."""

from __future__ import annotations

from typing import Protocol

from relit_camera.space.images import DisplayImage
from relit_camera.stream.director import Director
from relit_camera.stream.events import EventHub
from relit_camera.stream.status import CameraStatus


class CameraControl(Protocol):
    """The camera as seen by the API: implemented by `stream.daemon.Daemon`, and by a fake in the API's tests."""

    director: Director
    events: EventHub

    def status(self) -> CameraStatus:
        """What is going on; cheap enough for several calls a second."""
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
