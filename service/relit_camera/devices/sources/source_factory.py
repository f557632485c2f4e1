"""From what a person writes after `--source` to a source."""

from __future__ import annotations

from pathlib import Path

from relit_camera.base.config.settings import SourceSettings
from relit_camera.base.errors import DeviceError, VideoError
from relit_camera.base.images.image_files import LDR_SUFFIXES
from relit_camera.devices.sources.pattern_source import pattern_source
from relit_camera.devices.sources.playback_source import file_source, image_source
from relit_camera.devices.sources.source import Source
from relit_camera.devices.sources.webcam_source import WebcamSource
from relit_camera.devices.video_devices import SYSTEM_TREE, VIRTUAL_CAMERA_LABEL, DeviceTree


def open_source(
    settings: SourceSettings, *, own_label: str = VIRTUAL_CAMERA_LABEL, tree: DeviceTree = SYSTEM_TREE
) -> Source:
    """Make the source that `settings.source` names: `webcam`, a camera's id, `pattern`, a picture or a video file.

    Files, pictures and pattern keep their own time; a video begins anew after its end.

    Args:
        settings: source, and the size and rate to ask of a camera or pattern.
        own_label: name of the virtual camera that is published to: never a source.
        tree: where cameras are looked for.

    Raises:
        DeviceError: no such camera; the cure lists those that there are.
        VideoError: the file is missing or is no video.
        ImageError: the picture file cannot be read.
    """
    text, size = settings.source, (settings.width, settings.height)
    path = Path(text).expanduser()
    if text == "pattern":
        return pattern_source(size, settings.fps)
    if path.is_file():
        if path.suffix.lower() in LDR_SUFFIXES:
            return image_source(path, settings.fps)
        return file_source(path)
    try:
        return WebcamSource(text, size, settings.fps, tree=tree, own_label=own_label)
    except DeviceError as error:
        if path.suffix and not text.startswith(str(tree.dev)):
            raise VideoError(
                f"there is no file {text}", "check the path, or see 'relit devices' for cameras"
            ) from error
        raise
