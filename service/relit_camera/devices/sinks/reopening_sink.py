"""A sink whose device may be missing at first."""

from __future__ import annotations

from collections.abc import Callable

from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sinks.sink import Sink, SinkInfo


class ReopeningSink:
    """Opens a sink at once, or else with the first `write` for which its device is there.

    Attributes:
        opening_error: why it could not be opened at first; None where it could.
    """

    def __init__(self, open_sink: Callable[[], Sink], size: tuple[int, int]) -> None:
        """Open the sink.

        Args:
            open_sink: opens it.
            size: width and height in pixels of the pictures that it will get.

        Raises:
            RelitError: the settings are wrong; a device that is missing or in use is no such error.
        """
        self._open = open_sink
        self._missing = SinkInfo("camera", "", size)
        self._sink: Sink | None = None
        self.opening_error: DeviceError | None = None
        try:
            self._sink = open_sink()
        except DeviceError as error:
            self.opening_error = error

    def write(self, image: DisplayImage) -> None:
        """Show or keep a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: the device is missing or in use.
            StorageError: the file cannot be written.
            ImageError: the picture has another size.
        """
        if self._sink is None:
            self._sink = self._open()
        self._sink.write(image)

    def describe(self) -> SinkInfo:
        """Facts about the sink; without a node while its device is missing."""
        return self._missing if self._sink is None else self._sink.describe()

    def close(self) -> None:
        """Finish the output and free the device or file. Harmless when repeated.

        Raises:
            StorageError: the end of the file cannot be written, or the file was lost before.
        """
        if self._sink is not None:
            self._sink.close()
