"""Runs all checks of the doctor. None of them changes anything, and none prevents the others."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from relit_camera import __version__
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import NON_SETTING_VARIABLES, config_path, load_settings
from relit_camera.base.errors import ConfigError
from relit_camera.base.models.model_store import FOLDER_VARIABLE, models_folder
from relit_camera.devices.sinks.sink_factory import published_label
from relit_camera.doctor.camera_access import AccessCheck, check_pipewire, check_virtual_camera, check_webcam
from relit_camera.doctor.fix import apply_fixes
from relit_camera.doctor.host import Host
from relit_camera.doctor.installation import check_cores, check_folder, check_packages, check_python
from relit_camera.doctor.kernel_module import check_load_at_boot, check_module
from relit_camera.doctor.models_and_subject import check_models, check_provider, check_subject
from relit_camera.doctor.readers.browsers import check_browsers
from relit_camera.doctor.readers.call_apps import check_call_apps
from relit_camera.doctor.readers.camera_portal import check_portal
from relit_camera.doctor.report import Finding, Report, Severity, ok, problem_from_error
from relit_camera.doctor.running_processes import check_port, check_running
from relit_camera.doctor.systemd_unit import check_service


def run_checks(
    config: Path | None = None, host: Host | None = None, access: AccessCheck = os.access, with_fix: bool = False
) -> Report:
    """Check everything that the camera needs.

    Args:
        config: the configuration file; searched in the usual places if not given. If it has an error, the defaults are
            checked instead.
        host: the machine to check; this one if not given.
        access: whether this user may access a path: `os.access`, or a test's own.
        with_fix: first write the user's missing files (`doctor.fix`), but no folders if the configuration has an
            error; the checks run afterwards.
    """
    host = host or Host()
    settings, configuration = _check_configuration(config)
    fixed = None
    if with_fix:
        fixed = apply_fixes(settings, host, access, with_folders=configuration.state is Severity.OK)
        settings, configuration = _check_configuration(config)  # the fix may have written the file
    python, packages, *others = (check() for check in checks_of(settings, host, access))
    return Report(version=__version__, findings=(python, packages, configuration, *others), fix=fixed)


def checks_of(
    settings: RelitSettings, host: Host, access: AccessCheck = os.access
) -> tuple[Callable[[], Finding], ...]:
    """The checks of everything that the camera needs with these settings; none of them has run."""
    return (
        check_python,
        check_packages,
        lambda: check_cores(settings),
        lambda: check_folder("data folder", settings.storage.data_dir, "set storage.data_dir to a folder of yours"),
        lambda: check_folder("models folder", models_folder(), f"set {FOLDER_VARIABLE} to a folder of yours"),
        lambda: check_models(settings),
        lambda: check_provider(settings),
        lambda: check_subject(settings),
        lambda: check_webcam(settings.source, host, access, published_label(settings.output, host.tree)),
        lambda: check_module(settings.output, host),
        lambda: check_load_at_boot(settings.output, host),
        lambda: check_virtual_camera(settings.output, host, access),
        lambda: check_pipewire(settings.output, host),
        lambda: check_portal(host, settings=settings.output),
        lambda: check_browsers(host, settings=settings.output),
        lambda: check_call_apps(host, settings=settings.output),
        lambda: check_port(settings.server),
        check_running,
        lambda: check_service(host),
    )


def _check_configuration(config: Path | None) -> tuple[RelitSettings, Finding]:
    topic = "configuration"
    try:
        settings, path = load_settings(config), config_path(config)
    except ConfigError as error:
        # The other checks go on with the defaults: one error must not hide the others.
        return RelitSettings.model_construct(), problem_from_error(topic, error)
    set_in = sorted(name for name in os.environ if name.startswith("RELIT_") and name not in NON_SETTING_VARIABLES)
    seen = str(path.resolve()) if path else "no file, the defaults"
    return settings, ok(topic, f"{seen}; environment: {', '.join(set_in)}" if set_in else seen)
