"""Opens what call apps can see. The keeper does so too, so nothing is imported here that takes long or much memory."""

from __future__ import annotations

import os
import sys

from relit_camera.devices.device_discovery import list_virtual_cameras
from relit_camera.devices.sinks.call_app_sink import CallAppSink, CameraPlace
from relit_camera.devices.sinks.picture_conversion import I420Converter
from relit_camera.devices.sinks.pipewire.pipewire_sink import PipeWireSink, session_socket
from relit_camera.devices.sinks.sink import Sink, SinkOptions
from relit_camera.devices.sinks.virtual_camera_sink import LoopbackCamera, VirtualCameraSink


def open_virtual_camera(options: SinkOptions) -> Sink:
    """Open what call apps can see: the v4l2loopback device of the label, a camera in PipeWire, or both.

    Elsewhere than on Linux it is the virtual camera that pyvirtualcam finds.

    Raises:
        DeviceError: there is neither, or it is in use.
    """
    size, fps, label, tree = options.size, options.fps, options.label, options.tree
    if not sys.platform.startswith("linux"):
        return VirtualCameraSink(size, fps, label, tree=tree)
    convert = I420Converter()

    def device(size: tuple[int, int], fps: float, node: str) -> LoopbackCamera:
        return LoopbackCamera(size, node, convert)

    def loopback_is_there() -> bool:
        return any(camera.ours for camera in list_virtual_cameras(tree, label))

    def session_is_there() -> bool:
        socket = session_socket()
        return socket is not None and os.path.exists(socket)  # noqa: PTH110 - False where the folder may not be entered

    places = (
        CameraPlace("PipeWire", lambda: PipeWireSink(size, fps, label, convert=convert), session_is_there),
        CameraPlace(
            "v4l2loopback",
            lambda: VirtualCameraSink(size, fps, label, tree=tree, open_output=device),
            loopback_is_there,
        ),
    )
    return CallAppSink(places, size)


def open_pipewire(options: SinkOptions) -> Sink:
    """Open a camera in PipeWire alone.

    Raises:
        DeviceError: PipeWire is not installed, or no session runs.
    """
    return PipeWireSink(options.size, options.fps, options.label)
