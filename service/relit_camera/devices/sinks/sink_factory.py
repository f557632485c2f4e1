"""Sinks by name: which sink the text of `--sink` or of the setting `output.sink` opens.

A plug-in is an entry point of the group `relit_camera.sinks`: called with `SinkOptions`, it gives a `Sink`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import InputError
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.base.video.video_writer import VIDEO_SUFFIXES
from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, DeviceFolders, list_virtual_cameras
from relit_camera.devices.sinks.sink import NullSink, Sink
from relit_camera.devices.sinks.video_file_sink import VideoFileSink
from relit_camera.devices.sinks.virtual_camera_sink import VirtualCameraSink


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

    In this order: a plug-in (`NAME` or `NAME:ARGUMENT`; `camera` and `null` are of them), the node of a virtual camera
    such as /dev/video10, a video file.

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
    path = Path(text).expanduser()
    if path.suffix.lower() in VIDEO_SUFFIXES:
        return VideoFileSink(path, size, fps)
    names, endings = ", ".join(SINKS.names()), ", ".join(sorted(VIDEO_SUFFIXES))
    raise InputError(f"unknown sink '{text}'", f"use {names}, /dev/videoN, or a file ending in {endings}")


def open_virtual_camera(options: SinkOptions) -> Sink:
    """Open the virtual camera of the label.

    Raises:
        DeviceError: it is missing or in use.
    """
    return VirtualCameraSink(options.size, options.fps, options.label, tree=options.tree)


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
