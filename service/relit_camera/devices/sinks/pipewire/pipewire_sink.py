"""A camera in the user's PipeWire session as sink: no kernel module, no root."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from relit_camera.base.errors import DeviceError, InputError
from relit_camera.base.images.image_types import DisplayImage, check_image
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.devices.device_discovery import VIRTUAL_CAMERA_LABEL
from relit_camera.devices.sinks.picture_conversion import I420Converter
from relit_camera.devices.sinks.pipewire.pipewire_node import NO_SESSION_CURE, PipeWireNode
from relit_camera.devices.sinks.sink import Readers, SinkInfo


class SessionCamera(Protocol):
    """A camera in a session, as `PipeWireNode` is one."""

    def send(self, image: DisplayImage) -> None:
        """Give a picture to whoever reads. Raises OSError where the session has ended."""
        ...

    def readers(self) -> Readers:
        """The programs that read it now."""
        ...

    def close(self) -> None:
        """Take the camera away."""
        ...


OpenNode = Callable[[tuple[int, int], float, str], SessionCamera]
"""(size, frames a second, name) → the camera in the session."""


def session_socket(environment: Mapping[str, str] = os.environ) -> Path | None:
    """Where programs of this user reach PipeWire; None where the environment names no such place.

    As the library looks for it: a session of another name is that of PIPEWIRE_REMOTE, in PIPEWIRE_RUNTIME_DIR or else
    XDG_RUNTIME_DIR.
    """
    folder = environment.get("PIPEWIRE_RUNTIME_DIR") or environment.get("XDG_RUNTIME_DIR")
    name = Path(environment.get("PIPEWIRE_REMOTE") or "pipewire-0")
    if name.is_absolute():
        return name
    return Path(folder) / name if folder else None


class PipeWireSink:
    """Publishes pictures as a camera in PipeWire, of one fixed size.

    After a failed write, which means that the session has ended, the next one looks for a session again.
    """

    def __init__(
        self,
        size: tuple[int, int],
        fps: float,
        label: str = VIRTUAL_CAMERA_LABEL,
        *,
        convert: I420Converter | None = None,
        open_node: OpenNode | None = None,
    ) -> None:
        """Publish the camera.

        Args:
            size: width and height of the pictures, both even.
            fps: pictures a second, as readers are told.
            label: name of the camera.
            convert: makes I420 of pictures; shared where another camera takes the same ones.
            open_node: publishes the camera; a `PipeWireNode` if not given.

        Raises:
            InputError: the size is odd.
            DeviceError: PipeWire is not installed, or no session runs.
        """
        if size[0] % 2 or size[1] % 2:
            raise InputError(f"a virtual camera cannot be {size[0]}x{size[1]}", "use an even width and height")
        self._size, self._fps, self._label = size, fps, label
        converter = convert or I420Converter()
        self._open_node = open_node or (lambda size, fps, label: _open_node(size, fps, label, converter))
        self._node: SessionCamera | None = None
        self._open()

    def write(self, image: DisplayImage) -> None:
        """Show a picture, uint8 sRGB RGB (height, width, 3), to whoever reads.

        Raises:
            DeviceError: no session runs.
            ImageError: the array is no picture.
        """
        check_image(image, np.uint8, "picture to show")
        node = self._node or self._open()
        if (image.shape[1], image.shape[0]) != self._size:
            image = crop_to_fill(image, self._size)
        try:
            node.send(np.ascontiguousarray(image))
        except OSError as error:
            self.close()
            raise DeviceError(f"the PipeWire session has ended: {error.strerror}", NO_SESSION_CURE) from error

    def describe(self) -> SinkInfo:
        """Facts about the sink."""
        node = self._node  # other threads ask too, while the publisher's changes it
        return SinkInfo("camera", "", self._size, node.readers() if node is not None else None)

    def close(self) -> None:
        """Take the camera away. Harmless when repeated."""
        node, self._node = self._node, None
        if node is not None:
            node.close()

    def _open(self) -> SessionCamera:
        self._node = node = self._open_node(self._size, self._fps, self._label)
        return node


def _open_node(size: tuple[int, int], fps: float, label: str, convert: I420Converter) -> SessionCamera:
    """A `PipeWireNode`.

    Raises:
        DeviceError: PipeWire is not installed, or no session runs.
    """
    socket = session_socket()
    # The library would look as well, but takes its time.
    if socket is None or not os.path.exists(socket):  # noqa: PTH110 - False where the folder may not be entered
        where = f"there is no {socket}" if socket else "XDG_RUNTIME_DIR is not set"
        raise DeviceError(f"no PipeWire session runs: {where}", NO_SESSION_CURE)
    return PipeWireNode(size, fps, label, convert)
