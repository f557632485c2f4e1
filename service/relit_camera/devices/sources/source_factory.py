"""Sources by name: which source the text of `--source` or of the setting `source.source` opens.

A plug-in is an entry point of the group `relit_camera.sources`: called with `SourceOptions`, it gives a `Source`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.errors import DeviceError, VideoError
from relit_camera.base.images.image_files import LDR_SUFFIXES
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.devices.device_discovery import SYSTEM_FOLDERS, VIRTUAL_CAMERA_LABEL, DeviceFolders
from relit_camera.devices.sources.pattern_source import pattern_source
from relit_camera.devices.sources.playback_source import file_source, image_source
from relit_camera.devices.sources.source import Source
from relit_camera.devices.sources.webcam_source import WebcamSource


@dataclass(frozen=True)
class SourceOptions:
    """What every source is opened with.

    Attributes:
        argument: what follows the colon in `NAME:ARGUMENT`.
        size: (width, height) that is asked for; the source may give frames of another size.
        fps: frames a second that are asked for.
        own_label: name of the virtual camera that is published to, which must not be a source: it would film itself.
        tree: where cameras are looked for.
    """

    argument: str
    size: tuple[int, int]
    fps: float
    own_label: str = VIRTUAL_CAMERA_LABEL
    tree: DeviceFolders = SYSTEM_FOLDERS


SOURCES: PluginGroup[Callable[[SourceOptions], Source]] = PluginGroup(
    "relit_camera.sources", "source", with_argument=("webcam",)
)


def open_source(
    settings: SourceSettings, *, own_label: str = VIRTUAL_CAMERA_LABEL, tree: DeviceFolders = SYSTEM_FOLDERS
) -> Source:
    """Make the source that `settings.source` names.

    In this order: a picture or video file that exists, a plug-in (`NAME` or `NAME:ARGUMENT`; `webcam` and `pattern` are
    of them), a camera's id. Files, pictures and pattern keep their own time; a video begins anew after its end.

    Args:
        settings: source, and the size and rate to ask of a camera or pattern.
        own_label: name of the virtual camera that is published to: never a source.
        tree: where cameras are looked for.

    Raises:
        DeviceError: no such camera; the cure lists those that there are.
        VideoError: the file is missing or is no video.
        ImageError: the picture file cannot be read.
        ConfigError: the plug-in cannot be loaded.
        InputError: the plug-in takes no such argument.
    """
    text = settings.source
    options = SourceOptions(text, (settings.width, settings.height), settings.fps, own_label, tree)
    path = Path(text).expanduser()
    if path.is_file():
        if path.suffix.lower() in LDR_SUFFIXES:
            return image_source(path, settings.fps)
        return file_source(path)
    if SOURCES.has(text):
        factory, argument = SOURCES.load(text)
        return factory(replace(options, argument=argument))
    try:
        return open_webcam(options)
    except DeviceError as error:
        if path.suffix and not text.startswith(str(tree.dev)):
            raise VideoError(
                f"there is no file {text}", "check the path, or see 'relit devices' for cameras"
            ) from error
        raise


def open_webcam(options: SourceOptions) -> Source:
    """Open the webcam whose id is the argument, or the first there is.

    Raises:
        DeviceError: no such camera.
    """
    return WebcamSource(
        options.argument or "webcam", options.size, options.fps, tree=options.tree, own_label=options.own_label
    )


def open_pattern(options: SourceOptions) -> Source:
    """Open the moving test pattern."""
    return pattern_source(options.size, options.fps)
