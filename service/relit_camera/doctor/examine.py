"""All checks, one after the other. None of them changes anything, and none ends the others."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil

from relit_camera import __version__
from relit_camera.config.load import LOADER_VARIABLES, config_path, load_settings
from relit_camera.config.settings import RelitSettings, ServerSettings
from relit_camera.doctor.cameras import Access, check_virtual_camera, check_webcam
from relit_camera.doctor.findings import Finding, Report, State, fine, problem, problem_from
from relit_camera.doctor.inference import check_models, check_provider
from relit_camera.doctor.installation import check_cores, check_folder, check_packages, check_python
from relit_camera.errors import ConfigError
from relit_camera.models.registry import FOLDER_VARIABLE, models_folder
from relit_camera.stream.devices import SYSTEM, DeviceTree


def examine(config: Path | None = None, tree: DeviceTree = SYSTEM, access: Access = os.access) -> Report:
    """Look at everything that the camera needs.

    Args:
        config: the configuration file; the usual places if not given. Where it is at fault, the defaults are examined.
        tree: where devices are looked for.
        access: `os.access` or a stand-in.
    """
    settings, configuration = _configuration(config)
    checks: tuple[Callable[[], Finding], ...] = (
        check_python,
        check_packages,
        lambda: configuration,
        lambda: check_cores(settings),
        lambda: check_folder("data folder", settings.storage.data_dir, "set storage.data_dir to a folder of yours"),
        lambda: check_folder("models folder", models_folder(), f"set {FOLDER_VARIABLE} to a folder of yours"),
        lambda: check_models(settings),
        lambda: check_provider(settings),
        lambda: check_webcam(settings.source, tree, access, settings.output.label),
        lambda: check_virtual_camera(settings.output, tree, access),
        lambda: check_port(settings.server),
    )
    return Report(version=__version__, findings=tuple(check() for check in checks))


def table(report: Report) -> Iterator[str]:
    """The report as lines of plain text: state, topic, what was seen; the cure below it."""
    width = max(len(finding.topic) for finding in report.findings)
    for finding in report.findings:
        yield f"{finding.state:<7}  {finding.topic:<{width}}  {finding.seen}"
        if finding.cure:
            yield f"{'':7}  {'':{width}}  → {finding.cure}"
    counts = [(state, sum(f.state is state for f in report.findings)) for state in (State.PROBLEM, State.WARNING)]
    found = [f"{count} {state}{'s' if count > 1 else ''}" for state, count in counts if count]
    yield f"Relit Camera {report.version}: {', '.join(found) or 'all is well'}"


def check_port(settings: ServerSettings) -> Finding:
    """Whether API and panel can listen."""
    topic, place = "port", f"{settings.port} on {settings.host}"
    if settings.port == 0:
        return fine(topic, "a free one is picked when the camera starts")
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        socket.create_server((settings.host, settings.port), family=family).close()
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            return problem(topic, f"{place} cannot be used: {error.strerror}", "choose another with --port")
        owner = _listener(settings.port)
        if owner == "relit":
            return fine(topic, f"{place}: a Relit Camera is running there")
        who = f"in use by {owner}" if owner else "in use by another program"
        return problem(
            topic, f"{place} is {who}", "end that program, or choose another with --port; 0 picks a free one"
        )
    return fine(topic, f"{place} is free")


def _configuration(config: Path | None) -> tuple[RelitSettings, Finding]:
    topic = "configuration"
    try:
        settings, path = load_settings(config), config_path(config)
    except ConfigError as error:
        # Everything else is examined with the defaults: one fault shall not hide the others.
        return RelitSettings.model_construct(), problem_from(topic, error)
    set_in = sorted(name for name in os.environ if name.startswith("RELIT_") and name not in LOADER_VARIABLES)
    seen = str(path.resolve()) if path else "no file, the defaults"
    return settings, fine(topic, f"{seen}; environment: {', '.join(set_in)}" if set_in else seen)


def _listener(port: int) -> str:
    """Name of the program that listens on a port; "" where the system does not tell it."""
    try:
        for connection in psutil.net_connections("tcp"):
            if connection.status == psutil.CONN_LISTEN and connection.laddr[1:] == (port,) and connection.pid:
                process = psutil.Process(connection.pid)
                is_ours = any(Path(part).name == "relit" for part in process.cmdline()[:2])
                return "relit" if is_ours else f"{process.name()} (process {process.pid})"
    except psutil.Error:
        pass
    return ""
