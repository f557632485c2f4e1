"""Checks of the settings before a device is opened, for what is otherwise read only once source and sink are open."""

from __future__ import annotations

from pathlib import Path

from relit_camera.app.wiring import open_matting, require_plugins, session_options
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import ModelError
from relit_camera.base.models.session_with_fallback import require_provider
from relit_camera.devices.on_demand.on_demand_source import require_known_readers
from relit_camera.live.publishing.placeholder_image import placeholder


def check_before_devices(settings: RelitSettings) -> None:
    """Check the files and names in the settings that the camera service reads after source and sink are open.

    Look, subject, address, token and tracker are not checked here: `run_camera` itself uses them before it opens a
    device. A failure there or here leaves the webcam's light off and the virtual camera to other programs.

    Raises:
        ImageError: the placeholder picture cannot be read.
        NotFoundError: no tracker, relighter, reenactor or matte has the name in the settings.
        ConfigError: several packages have a plug-in of that name, or it cannot be imported; there is no such execution
            provider; or the source shall open on demand, and this system does not tell who reads the virtual camera.
        InputError: the recorded mattes cannot be read; or a built-in plug-in takes no argument.
        DeviceError: a strict execution provider is not built in.
        ModelError: the file of an ONNX reenactor does not exist.
    """
    session = session_options(settings.inference)
    require_plugins(settings)
    require_provider(session)
    if settings.source.on_demand and settings.output.sink == "camera":
        require_known_readers()
    if settings.output.placeholder is not None:
        placeholder((settings.output.width, settings.output.height), picture=settings.output.placeholder)
    open_matting(settings.matte, session)
    reenactor, _, file = settings.reenact.reenactor.partition(":")
    if reenactor == "onnx" and not (file and Path(file).expanduser().is_file()):
        said = f"{file} does not exist" if file else "reenactor onnx needs a network"
        raise ModelError(said, "name the file of an ONNX reenactor, onnx:FILE (docs/reenactors.md)")
