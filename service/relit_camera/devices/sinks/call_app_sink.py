"""What call apps can see, as one sink: a v4l2loopback device where there is one, and PipeWire where a session runs."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sinks.sink import Sink, SinkInfo

log = logging.getLogger(__name__)

RETRY_S = 1.0
"""Seconds after which a camera that failed is looked for again, while another one is shown."""


@dataclass(frozen=True)
class CameraPlace:
    """One way on which call apps find a camera.

    Attributes:
        name: what it is, for people.
        open: opens a sink there; raises DeviceError where it cannot.
        is_there: whether a camera could be there: then it is a fault if it cannot be opened.
    """

    name: str
    open: Callable[[], Sink]
    is_there: Callable[[], bool]


class CallAppSink:
    """Shows each picture at every place where a camera can be. It works as long as one of them does."""

    def __init__(self, places: tuple[CameraPlace, ...], size: tuple[int, int], clock: Clock = SYSTEM_CLOCK) -> None:
        """Open what can be opened.

        Args:
            places: where cameras may be; what the first one needs is told first where there is none.
            size: width and height of the pictures.
            clock: to measure by.

        Raises:
            DeviceError: none can be opened.
        """
        self._cameras = [_Camera(place, clock) for place in places]
        self._size = size
        for camera in self._cameras:
            camera.attempt(None)
        self._require_one()

    def write(self, image: DisplayImage) -> None:
        """Show a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: there is no camera.
            ImageError: the array is no picture.
        """
        for camera in self._cameras:
            camera.attempt(image)
        self._require_one()

    def describe(self) -> SinkInfo:
        """Facts about the cameras that are open, and what is wrong with one that is there."""
        sinks = [camera.sink for camera in self._cameras]  # other threads ask too, while the publisher's changes them
        found = [sink.describe() for sink in sinks if sink is not None]
        troubles = [camera.trouble for camera in self._cameras]
        info = SinkInfo("camera", "", self._size, trouble=next(filter(None, troubles), None) if found else None)
        for each in found:
            if each.id:
                info = replace(info, id=each.id, size=each.size)
            if each.pipewire is not None:
                info = replace(info, pipewire=each.pipewire)
        return info

    def close(self) -> None:
        """Close all cameras. Harmless when repeated."""
        for camera in self._cameras:
            camera.close()

    def _require_one(self) -> None:
        errors = [camera.error for camera in self._cameras if camera.error is not None]
        if len(errors) < len(self._cameras):
            return
        # Where a camera is there, what keeps it from working is to be cured, not that another one is missing.
        told = [camera.trouble for camera in self._cameras if camera.trouble is not None] or errors
        what = "; ".join(error.what for error in told)
        raise DeviceError(what, "; or ".join(error.cure for error in told if error.cure))


class _Camera:
    """One place, and the sink that is open there.

    Attributes:
        sink: None while it cannot be opened.
        error: why not, or why it failed; None while it works.
        trouble: the same where a camera could be there.
    """

    def __init__(self, place: CameraPlace, clock: Clock) -> None:
        self.place, self._clock = place, clock
        self.sink: Sink | None = None
        self.error: DeviceError | None = None
        self.trouble: DeviceError | None = None
        self._retry_at = 0.0

    def attempt(self, image: DisplayImage | None) -> None:
        """Open it if it is not, and show a picture, if one is given; not while the last failure is too recent."""
        if self.error is not None and self._clock.now() < self._retry_at:
            return
        try:
            if self.sink is None:
                self.sink = self.place.open()
            if image is not None:
                self.sink.write(image)
        except DeviceError as error:
            if self.error is None or self.error.what != error.what:
                log.info("%s: %s", self.place.name, error.what)
            self.error, self._retry_at = error, self._clock.now() + RETRY_S
            self.trouble = error if self.place.is_there() else None
            self.close()
        else:
            if self.error is not None:
                log.info("%s: the camera is there", self.place.name)
            self.error = self.trouble = None

    def close(self) -> None:
        """Close its sink."""
        sink, self.sink = self.sink, None
        if sink is not None:
            sink.close()
