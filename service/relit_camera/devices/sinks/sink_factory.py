"""Sinks by name: which sink the text of `--sink` or of the setting `output.sink` opens.

A plug-in is an entry point of the group `relit_camera.sinks`: called with `SinkOptions`, it gives a `Sink`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import InputError
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, DeviceFolders, list_virtual_cameras
from relit_camera.devices.sinks.call_app_sink import CallAppSink, CameraPlace
from relit_camera.devices.sinks.picture_conversion import I420Converter
from relit_camera.devices.sinks.pipewire.pipewire_sink import PipeWireSink, session_socket
from relit_camera.devices.sinks.sink import NullSink, Sink
from relit_camera.devices.sinks.virtual_camera_sink import VirtualCameraSink
from relit_camera.devices.v4l2loopback_output import LoopbackDevice


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


SINKS: PluginGroup[Callable[[SinkOptions], Sink]] = PluginGroup("relit_camera.sinks", "sink")


def open_sink(settings: OutputSettings, tree: DeviceFolders = SYSTEM_FOLDERS) -> Sink:
    """Open the sink that `settings.sink` names.

    In this order: a plug-in (`NAME` or `NAME:ARGUMENT`; `camera`, `pipewire` and `null` are of them), the node of a
    virtual camera such as /dev/video10, a video file.

    Raises:
        InputError: none of these, or the plug-in takes no such argument.
        ConfigError: the plug-in cannot be loaded.
        DeviceError: the virtual camera is missing or in use.
        StorageError: the file cannot be written.
    """
    text, size, fps = settings.sink, (settings.width, settings.height), settings.fps
    if SINKS.has(text):
        factory, argument = SINKS.load(text)
        return factory(SinkOptions(argument, size, fps, settings.label, tree))
    if node := _node(text, tree):
        return VirtualCameraSink(size, fps, settings.label, device=node, tree=tree)
    # FFmpeg is loaded only where it is needed: it takes a fifth of a second, and 15 MB.
    from relit_camera.base.video.video_writer import VIDEO_SUFFIXES
    from relit_camera.devices.sinks.video_file_sink import VideoFileSink

    path = Path(text).expanduser()
    if path.suffix.lower() in VIDEO_SUFFIXES:
        return VideoFileSink(path, size, fps)
    names, endings = ", ".join(SINKS.names()), ", ".join(sorted(VIDEO_SUFFIXES))
    raise InputError(f"unknown sink '{text}'", f"use {names}, /dev/videoN, or a file ending in {endings}")


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

    def open_loopback() -> Sink:
        def device(size: tuple[int, int], fps: float, node: str) -> LoopbackDevice:
            return LoopbackDevice(size, node, convert)

        return VirtualCameraSink(size, fps, label, tree=tree, open_output=device)

    def loopback_is_there() -> bool:
        return any(camera.ours for camera in list_virtual_cameras(tree, label))

    def session_is_there() -> bool:
        socket = session_socket()
        return socket is not None and socket.exists()

    places = (
        CameraPlace("PipeWire", lambda: PipeWireSink(size, fps, label, convert=convert), session_is_there),
        CameraPlace("v4l2loopback", open_loopback, loopback_is_there),
    )
    return CallAppSink(places, size)


def open_pipewire(options: SinkOptions) -> Sink:
    """Open a camera in PipeWire alone.

    Raises:
        DeviceError: PipeWire is not installed, or no session runs.
    """
    return PipeWireSink(options.size, options.fps, options.label)


def open_null(options: SinkOptions) -> Sink:
    """Open the sink that shows nothing."""
    return NullSink(options.size)


def published_label(settings: OutputSettings, tree: DeviceFolders = SYSTEM_FOLDERS) -> str:
    """Name the virtual camera that will be published to, which must not be taken as source: it would film itself."""
    labels = {camera.node: camera.label for camera in list_virtual_cameras(tree)}
    return labels.get(_node(settings.sink, tree), settings.label)


def _node(text: str, tree: DeviceFolders) -> str:
    """The device file that is named, itself or by a link of udev's; empty where none is."""
    path = Path(text).resolve()
    return str(path) if path.parent == tree.dev and re.fullmatch(r"video\d+", path.name) else ""
