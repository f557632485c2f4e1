"""Checks for programs that are in the way: on the API's port, or another Relit Camera."""

from __future__ import annotations

import errno
import os
import socket
from pathlib import Path

import psutil

from relit_camera.base.config.settings import ServerSettings
from relit_camera.doctor.report import Finding, ok, problem, warning

CAMERA_COMMANDS = ("run", "demo")


def check_port(settings: ServerSettings) -> Finding:
    """Check that API and panel can listen on their port."""
    topic, where = "port", f"{settings.port} on {settings.host}"
    if settings.port == 0:
        return ok(topic, "a free one is picked when the camera starts")
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        socket.create_server((settings.host, settings.port), family=family).close()
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            return problem(topic, f"{where} cannot be used: {error.strerror}", "choose another with --port")
        owner = _port_owner(settings.port)
        if owner == "relit":
            return ok(topic, f"{where}: a Relit Camera is running there")
        who = f"in use by {owner}" if owner else "in use by another program"
        return problem(
            topic, f"{where} is {who}", "end that program, or choose another with --port; 0 picks a free one"
        )
    return ok(topic, f"{where} is free")


def check_running() -> Finding:
    """Check how many Relit Cameras run: one may publish to the virtual camera, a second is refused."""
    topic, found = "running", running_cameras()
    if len(found) > 1:
        numbers = " ".join(str(pid) for pid in found[1:])
        return warning(
            topic, f"{len(found)} Relit Cameras run (processes {_format_pids(found)})", f"run: kill {numbers}"
        )
    return ok(topic, f"a Relit Camera runs (process {found[0]})" if found else "no Relit Camera runs")


def running_cameras() -> list[int]:
    """Numbers of the processes that are `relit run` or `relit demo`, as far as this user may see them."""
    found = []
    for process in psutil.process_iter(["cmdline"]):
        command = process.info["cmdline"] or []
        at = next((i for i, part in enumerate(command[:2]) if Path(part).name == "relit"), None)
        if at is not None and process.pid != os.getpid() and any(part in CAMERA_COMMANDS for part in command[at + 1 :]):
            found.append(process.pid)
    return found


def _format_pids(pids: list[int]) -> str:
    return ", ".join(str(pid) for pid in pids)


def _port_owner(port: int) -> str:
    """Name of the program that listens on a port; "" where the system does not show it."""
    try:
        for connection in psutil.net_connections("tcp"):
            if connection.status == psutil.CONN_LISTEN and connection.laddr[1:] == (port,) and connection.pid:
                process = psutil.Process(connection.pid)
                is_ours = any(Path(part).name == "relit" for part in process.cmdline()[:2])
                return "relit" if is_ours else f"{process.name()} (process {process.pid})"
    except psutil.Error:
        pass
    return ""
