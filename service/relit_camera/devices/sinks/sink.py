"""The protocol of sinks, and the null sink."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, DeviceFolders


@dataclass(frozen=True)
class SinkOptions:
    """What every sink is opened with.

    Attributes:
        argument: what follows the colon in `NAME:ARGUMENT`.
        size: (width, height) of all pictures that it will get.
        fps: pictures a second that it will get.
        label: name under which call apps shall show it.
        tree: where virtual cameras are looked for.
    """

    argument: str
    size: tuple[int, int]
    fps: float
    label: str
    tree: DeviceFolders = SYSTEM_FOLDERS


@dataclass(frozen=True)
class Readers:
    """Programs that take pictures from the virtual camera now."""

    count: int | None = None
    """None where it cannot be known: no virtual camera is open, or the system does not tell."""
    names: tuple[str, ...] = ()
    """Of those of the same user, such as `firefox`; there may be fewer than `count`."""


UNKNOWN = Readers()


@dataclass(frozen=True)
class SinkInfo:
    """Facts about a sink.

    Attributes:
        kind: camera, file or null.
        id: device node, path, or empty.
        size: width and height in pixels of the pictures that it takes, fixed for its life.
        pipewire: who reads it through PipeWire; None where it is not published there.
        trouble: why a camera that is there is not used, while another one is; None where all is well.
    """

    kind: str
    id: str
    size: tuple[int, int]
    pipewire: Readers | None = None
    trouble: DeviceError | None = None

    @property
    def place(self) -> str:
        """Where it shows pictures, in words, such as `/dev/video10 and PipeWire`; empty where it does not."""
        return " and ".join(filter(None, (self.id, "PipeWire" if self.pipewire is not None else "")))

    @property
    def name(self) -> str:
        """Kind and place in words, such as `camera /dev/video10 and PipeWire`."""
        return f"{self.kind} {self.place}".strip()


class Sink(Protocol):
    """Takes pictures of one size, from one thread.

    After a failure it may be written to again: a camera is then opened again. A file that failed is lost, and every
    further call raises the error again.
    """

    def write(self, image: DisplayImage) -> None:
        """Show or keep a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: the virtual camera is gone or in use.
            StorageError: the file cannot be written.
            ImageError: the picture has another size.
        """
        ...

    def describe(self) -> SinkInfo:
        """Facts about the sink."""
        ...

    def close(self) -> None:
        """Finish the output and free the device or file. Harmless when repeated.

        Raises:
            StorageError: the end of the file cannot be written, or the file was lost before.
        """
        ...


class NullSink:
    """A sink without output, for measuring and for running with the preview alone. Counts pictures, keeps the last.

    Attributes:
        count: pictures written.
        last: the newest, or None.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._info = SinkInfo("null", "", size)
        self.count = 0
        self.last: DisplayImage | None = None

    def write(self, image: DisplayImage) -> None:
        """Count a picture."""
        self.last = image
        self.count += 1

    def describe(self) -> SinkInfo:
        """Facts about the sink."""
        return self._info

    def close(self) -> None:
        """Do nothing."""
