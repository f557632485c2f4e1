"""Checks of the settings before a device is opened, for what is otherwise read only once source and sink are open."""

from __future__ import annotations

from pathlib import Path

from relit_camera.app.wiring import require_plugins, session_options
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ModelError
from relit_camera.live.compositing.matting import matting_factory
from relit_camera.live.publishing.placeholder_image import placeholder


def check_before_devices(settings: RelitSettings) -> None:
    """Check the files and names in the settings that the camera service reads after source and sink are open.

    Look, subject, address, token and tracker are not checked here: `run_camera` itself uses them before it opens a
    device. A failure there or here leaves the webcam's light off and the virtual camera to other programs.

    Raises:
        ImageError: the placeholder picture cannot be read.
        NotFoundError: no tracker, relighter, reenactor or matte has the name in the settings.
        ConfigError: several packages have a plug-in of that name.
        InputError: the recorded mattes cannot be read.
        ModelError: the file of an ONNX reenactor does not exist.
    """
    require_plugins(settings)
    placeholder((settings.output.width, settings.output.height), picture=settings.output.placeholder)
    matting_factory(settings.matte, session_options(settings.inference))
    reenactor, _, file = settings.reenact.reenactor.partition(":")
    if reenactor == "onnx" and not (file and Path(file).expanduser().is_file()):
        said = f"{file} does not exist" if file else "reenactor onnx needs a network"
        raise ModelError(said, "name the file of an ONNX reenactor, onnx:FILE (docs/reenactors.md)")
