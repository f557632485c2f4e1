"""The checks as the running camera tells them, with the commands of their cures, to be copied.

The camera calls this in a worker process: nothing is imported here that would stay in the camera's own memory.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from relit_camera.base.config.settings import RelitSettings
from relit_camera.live.status.setup_status import Check, CheckState

if TYPE_CHECKING:
    from relit_camera.doctor.host import Host
    from relit_camera.doctor.report import Finding

log = logging.getLogger(__name__)

_COMMAND = re.compile(r"(?:run: |on the host itself, )(.+?)(?=; |, and log in|$)|run `([^`]+)`")
"""How the cures name a command, the only one or the first of several ways."""
KERNEL_MODULE = "kernel module"
STATES = {"ok": CheckState.OK, "warning": CheckState.WARNING, "problem": CheckState.FAILED}


def check_camera(values: Mapping[str, Any], host: Host | None = None) -> tuple[Check, ...]:
    """Check everything that a camera with some settings needs. Takes a second or two.

    Args:
        values: the settings, as `RelitSettings.model_dump` gives them.
        host: the machine to check; this one if not given.
    """
    from relit_camera.doctor.host import Host
    from relit_camera.doctor.run_checks import checks_of

    machine, settings = host or Host(), RelitSettings.model_validate(values)
    return tuple(
        _check(finding, settings, machine) if finding is not None else _UNKNOWN
        for finding in map(_finding, checks_of(settings, machine))
    )


def commands_of(cure: str) -> tuple[str, ...]:
    """The commands that a cure names."""
    return tuple(first or second for first, second in _COMMAND.findall(cure))


_UNKNOWN = Check(
    "check", "A check", CheckState.UNKNOWN, "it failed in a way that nobody expected", "the log has it: report it"
)


def _finding(check: Callable[[], Finding]) -> Finding | None:
    """What a check finds; None where it failed itself, which must not hide the others."""
    try:
        return check()
    except Exception:
        log.exception("a check failed")
        return None


def _check(finding: Finding, settings: RelitSettings, host: Host) -> Check:
    commands = commands_of(finding.cure)
    state = STATES[finding.state]
    has_kernel = (host.root / "lib/modules" / host.release).is_dir()  # a container has not
    if finding.topic == KERNEL_MODULE and state is not CheckState.OK and has_kernel:
        from relit_camera.doctor.kernel_module import root_commands

        needed = [line for line in root_commands(settings.output, host) if not line.startswith("#")]
        commands = tuple(needed) or commands  # from nothing to a camera that is there after a restart too
    return Check(
        id=finding.topic.replace(" ", "-"),
        title=finding.topic[0].upper() + finding.topic[1:],
        state=state,
        what=finding.seen,
        cure=finding.cure,
        commands=commands,
    )
