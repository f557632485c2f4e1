"""Sinks by name: which sink the text of `--sink` or of the setting `output.sink` opens.

A plug-in is an entry point of the group `relit_camera.sinks`: called with `SinkOptions`, it gives a `Sink`.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from operator import call
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import InputError
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.devices.device_discovery import (
    SYSTEM_FOLDERS,
    DeviceFolders,
    find_virtual_camera,
    list_virtual_cameras,
)
from relit_camera.devices.sinks.call_app_sink import CallAppSink, CameraPlace
from relit_camera.devices.sinks.picture_conversion import I420Converter
from relit_camera.devices.sinks.pipewire.pipewire_sink import PipeWireSink, session_socket
from relit_camera.devices.sinks.sink import NullSink, Sink
from relit_camera.devices.sinks.virtual_camera_sink import LoopbackCamera, VirtualCameraSink

Hold = Callable[[Callable[[], Sink]], Sink]
"""Opens a v4l2loopback device, given what opens it in this process."""


@dataclass(frozen=True)
class SinkOptions:
    """What every sink is opened with.

    Attributes:
        argument: what follows the colon in `NAME:ARGUMENT`.
        size: (width, height) of all pictures that it will get.
        fps: pictures a second that it will get.
        label: name under which call apps shall show it.
        tree: where virtual cameras are looked for.
        hold: so that a keeper may hold a v4l2loopback device.
    """

    argument: str
    size: tuple[int, int]
    fps: float
    label: str
    tree: DeviceFolders = SYSTEM_FOLDERS
    hold: Hold = call


SINKS: PluginGroup[Callable[[SinkOptions], Sink]] = PluginGroup("relit_camera.sinks", "sink")


def open_sink(settings: OutputSettings, tree: DeviceFolders = SYSTEM_FOLDERS, hold: Hold = call) -> Sink:
    """Open the sink that `settings.sink` names; `hold` as in `SinkOptions`.

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
        return factory(SinkOptions(argument, size, fps, settings.label, tree, hold))
    if node := device_node(text, tree):
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
        def device(size: tuple[int, int], fps: float, node: str) -> LoopbackCamera:
            return LoopbackCamera(size, node, convert)

        find_virtual_camera(tree, label)  # where there is none nothing is started to hold it
        return options.hold(lambda: VirtualCameraSink(size, fps, label, tree=tree, open_output=device))

    def loopback_is_there() -> bool:
        return any(camera.ours for camera in list_virtual_cameras(tree, label))

    def session_is_there() -> bool:
        socket = session_socket()
        return socket is not None and os.path.exists(socket)  # noqa: PTH110 - False where the folder may not be entered

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
    return labels.get(device_node(settings.sink, tree), settings.label)


def device_node(text: str, tree: DeviceFolders = SYSTEM_FOLDERS) -> str:
    """The device file that a sink's text names, itself or by a link of udev's; empty where it names none."""
    path = Path(text).resolve()
    return str(path) if path.parent == tree.dev and re.fullmatch(r"video\d+", path.name) else ""
