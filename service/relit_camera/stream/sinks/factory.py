"""From what a person writes after `--sink` to a sink."""

from __future__ import annotations

import re
from pathlib import Path

from relit_camera.config.settings import OutputSettings
from relit_camera.errors import InputError
from relit_camera.stream.devices import SYSTEM, DeviceTree, list_virtual_cameras
from relit_camera.stream.sinks.base import Sink
from relit_camera.stream.sinks.camera import CameraSink
from relit_camera.stream.sinks.file import FileSink
from relit_camera.stream.sinks.null import NullSink
from relit_camera.video.writer import VIDEO_SUFFIXES


def open_sink(settings: OutputSettings, tree: DeviceTree = SYSTEM) -> Sink:
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
        return CameraSink(size, fps, settings.label, tree=tree)
    if node := _node(text, tree):
        return CameraSink(size, fps, settings.label, device=node, tree=tree)
    path = Path(text).expanduser()
    if path.suffix.lower() in VIDEO_SUFFIXES:
        return FileSink(path, size, fps)
    endings = ", ".join(sorted(VIDEO_SUFFIXES))
    raise InputError(f"unknown sink '{text}'", f"use camera, null, /dev/videoN, or a file ending in {endings}")


def published_label(settings: OutputSettings, tree: DeviceTree = SYSTEM) -> str:
    """Name the virtual camera that will be published to, which must not be taken as source: it would film itself."""
    labels = {camera.node: camera.label for camera in list_virtual_cameras(tree)}
    return labels.get(_node(settings.sink, tree), settings.label)


def _node(text: str, tree: DeviceTree) -> str:
    """The device file that is named, itself or by a link of udev's; empty where none is."""
    path = Path(text).resolve()
    return str(path) if path.parent == tree.dev and re.fullmatch(r"video\d+", path.name) else ""
