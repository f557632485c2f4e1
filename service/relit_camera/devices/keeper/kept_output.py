"""What the keeper holds: a v4l2loopback device, which needs Python's own library alone, or a sink."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from typing import Any, Protocol

from relit_camera.base.errors import DeviceError
from relit_camera.devices.sinks.camera_device import CameraDevice
from relit_camera.devices.v4l2loopback_output import LoopbackDevice

I420, RGB = "I420", "RGB"
"""Layouts of a picture's bytes: planes Y, U, V, the last two of half width and height (BT.601, limited range); or rows
of sRGB pixels, three bytes each."""


@dataclass(frozen=True)
class OutputOptions:
    """What a keeper is to hold. Two cameras that give the same continue one another.

    Attributes:
        size: (width, height) asked for.
        fps: pictures a second.
        label: name under which call apps show it.
        device: node of a v4l2loopback device, such as /dev/video10; empty to find it by the label.
        sink: `module:function` that opens a sink, given `SinkOptions`; empty for a v4l2loopback device.
        argument: what follows the colon of the sink's name.
    """

    size: tuple[int, int]
    fps: float
    label: str
    device: str = ""
    sink: str = ""
    argument: str = ""


def picture_bytes(size: tuple[int, int], layout: str) -> int:
    """Bytes of a picture of (width, height) in a layout."""
    return size[0] * size[1] * 3 // (2 if layout == I420 else 1)


class KeptOutput(Protocol):
    """An open virtual camera.

    Attributes:
        size: (width, height) of the pictures that it takes.
        layout: of its pictures.
    """

    size: tuple[int, int]
    layout: str

    @property
    def place(self) -> str:
        """Where it shows pictures, in words."""
        ...

    @property
    def is_bound(self) -> bool:
        """Whether programs read it that would lose it if it was closed, even if it was opened again at once."""
        ...

    def describe(self) -> dict[str, Any]:
        """Its `SinkInfo` as JSON has it; may change with each picture."""
        ...

    def send(self, picture: memoryview) -> None:
        """Show a picture of `size` in `layout`; the same object again is the same picture.

        Raises:
            RelitError: it is not taken.
        """
        ...

    def close(self) -> None:
        """Close it."""
        ...


def open_kept_output(options: OutputOptions) -> KeptOutput:
    """Open what the options name.

    Raises:
        RelitError: it is missing or in use.
    """
    return SinkOutput(options) if options.sink else LoopbackOutput(options)


def prepare_output(options: OutputOptions) -> None:
    """Load what `open_kept_output` needs: while another keeper still holds the virtual camera."""
    if options.sink:
        _sink_opener(options)


class LoopbackOutput:
    """A v4l2loopback device, which takes I420."""

    layout = I420

    def __init__(self, options: OutputOptions) -> None:
        self._camera = CameraDevice(
            options.size,
            options.fps,
            lambda size, fps, node: LoopbackDevice(size, node),
            options.label,
            options.device or None,
        )
        self._device: LoopbackDevice = self._camera.open()
        self.size = self._device.size

    @property
    def place(self) -> str:
        """Its node."""
        return self._device.node

    @property
    def is_bound(self) -> bool:
        """False: the device is there whoever writes to it."""
        return False

    def describe(self) -> dict[str, Any]:
        """Its `SinkInfo` as JSON has it."""
        return {"kind": "camera", "id": self._device.node, "size": self.size, "pipewire": None, "trouble": None}

    def send(self, picture: memoryview) -> None:
        """Show a picture.

        Raises:
            DeviceError: it is not taken.
        """
        try:
            self._device.send_planes(picture)
        except OSError as error:
            raise DeviceError(f"the virtual camera {self._device.node} takes no pictures: {error}") from error

    def close(self) -> None:
        """Close it."""
        self._camera.close()


class SinkOutput:
    """A sink. Its pictures are copied, for a sink may hold one for longer than the shared memory does."""

    layout = RGB

    def __init__(self, options: OutputOptions) -> None:
        import numpy as np

        self._sink: Any = _sink_opener(options)()
        self.size = options.size
        self._array: Callable[[memoryview], Any] = lambda picture: np.array(picture, np.uint8).reshape(
            self.size[1], self.size[0], 3
        )
        self._last: tuple[memoryview, Any] | None = None

    @property
    def place(self) -> str:
        """Where the sink shows pictures, in words."""
        return str(self._sink.describe().place)

    @property
    def is_bound(self) -> bool:
        """Whether programs read it through PipeWire, where it is another camera each time that it is opened."""
        readers = self._sink.describe().pipewire
        return readers is not None and bool(readers.count)

    def describe(self) -> dict[str, Any]:
        """Its `SinkInfo` as JSON has it."""
        info = self._sink.describe()
        return {
            "kind": info.kind,
            "id": info.id,
            "size": info.size,
            "pipewire": None if info.pipewire is None else [info.pipewire.count, info.pipewire.names],
            "trouble": None if info.trouble is None else [info.trouble.what, info.trouble.cure],
        }

    def send(self, picture: memoryview) -> None:
        """Show a picture; raises what the sink raises. The same object again is the same picture, for the sink too."""
        if self._last is None or self._last[0] is not picture:
            self._last = picture, self._array(picture)
        self._sink.write(self._last[1])

    def close(self) -> None:
        """Close it."""
        self._sink.close()


def _sink_opener(options: OutputOptions) -> Callable[[], Any]:
    from relit_camera.devices.sinks.sink import SinkOptions

    module, _, function = options.sink.partition(":")
    opener = getattr(import_module(module), function)
    return partial(opener, SinkOptions(options.argument, options.size, options.fps, options.label))
