"""From what a person writes after `--sink` to a sink."""

from __future__ import annotations

import re
from pathlib import Path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import InputError
from relit_camera.base.video.video_writer import VIDEO_SUFFIXES
from relit_camera.devices.sinks.sink import NullSink, Sink
from relit_camera.devices.sinks.video_file_sink import VideoFileSink
from relit_camera.devices.sinks.virtual_camera_sink import VirtualCameraSink
from relit_camera.devices.video_devices import SYSTEM_TREE, DeviceTree, list_virtual_cameras


def open_sink(settings: OutputSettings, tree: DeviceTree = SYSTEM_TREE) -> Sink:
    """Open the sink that `settings.sink` names: `camera`, `null`, a node such as /dev/video10, or a video file.

    Raises:
        InputError: none of these.
        DeviceError: the virtual camera is missing or in use.
        StorageError: the file cannot be written.
    """
    text, size, fps = settings.sink, (settings.width, settings.height), settings.fps
    if text == "null":
        return NullSink(size)
    if text == "camera":
        return VirtualCameraSink(size, fps, settings.label, tree=tree)
    if node := _node(text, tree):
        return VirtualCameraSink(size, fps, settings.label, device=node, tree=tree)
    path = Path(text).expanduser()
    if path.suffix.lower() in VIDEO_SUFFIXES:
        return VideoFileSink(path, size, fps)
    endings = ", ".join(sorted(VIDEO_SUFFIXES))
    raise InputError(f"unknown sink '{text}'", f"use camera, null, /dev/videoN, or a file ending in {endings}")


def published_label(settings: OutputSettings, tree: DeviceTree = SYSTEM_TREE) -> str:
    """Name the virtual camera that will be published to, which must not be taken as source: it would film itself."""
    labels = {camera.node: camera.label for camera in list_virtual_cameras(tree)}
    return labels.get(_node(settings.sink, tree), settings.label)


def _node(text: str, tree: DeviceTree) -> str:
    """The device file that is named, itself or by a link of udev's; empty where none is."""
    path = Path(text).resolve()
    return str(path) if path.parent == tree.dev and re.fullmatch(r"video\d+", path.name) else ""
