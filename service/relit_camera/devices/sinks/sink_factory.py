"""Sinks by name: which sink the text of `--sink` or of the setting `output.sink` opens.

A plug-in is an entry point of the group `relit_camera.sinks`: called with `SinkOptions`, it gives a `Sink`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import InputError
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, DeviceFolders, list_virtual_cameras
from relit_camera.devices.sinks.sink import NullSink, Sink, SinkOptions
from relit_camera.devices.sinks.virtual_camera_sink import VirtualCameraSink

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
