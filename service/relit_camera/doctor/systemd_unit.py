"""The systemd user unit that runs the camera from login on: its text, and the check of the installed one.

Its first line holds a checksum of the rest. A unit whose checksum fits was written by some version of this program and
may be replaced; any other was changed by a person and is never overwritten.
"""

from __future__ import annotations

import sys
from hashlib import sha256
from pathlib import Path

from platformdirs import user_config_path

from relit_camera.doctor.host import Host
from relit_camera.doctor.report import Finding, ok, warning

UNIT_NAME = "relit-camera.service"
CHECKSUM_PREFIX = "# By `relit doctor --fix`, sum "
CHECKSUM_SUFFIX = (
    ". Changed files are left alone; `systemctl --user edit relit-camera` changes it without touching it.\n"
)
FIX_CURE = "run: relit doctor --fix"

# No mount namespaces (PrivateTmp, ProtectHome …): the user's manager would need user namespaces for them, in which the
# groups that own the cameras are lost. No MemoryDenyWriteExecute: CUDA and OpenVINO make code while they run.
# KillMode=process: the keeper goes on while the camera is restarted, and ends by itself when nobody comes for it; the
# camera's other workers end with it. RestartSec: the camera should be back while the keeper shows the last picture.
# No limit of starts: whatever ends the camera, it must start when that is mended hours later.
UNIT_TEMPLATE = """\
[Unit]
Description=Relit Camera: a virtual webcam that shows you lit by any place you choose
StartLimitIntervalSec=0

[Service]
Type=notify
ExecStart={command} run
TimeoutStartSec=120
TimeoutStopSec=10
WatchdogSec=30
Restart=on-failure
RestartSec=2
KillMode=process
UMask=0077
NoNewPrivileges=yes
LockPersonality=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
RestrictNamespaces=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
SystemCallErrorNumber=EPERM

[Install]
WantedBy=default.target
"""


def unit_path() -> Path:
    """The file of the unit, in the folder in which systemd looks for the user's own units."""
    return user_config_path("systemd", appauthor=False) / "user" / UNIT_NAME


def relit_command() -> Path:
    """The path of the command `relit` as it was called, else beside this Python.

    Links are not resolved: those of pipx stay the same over updates.
    """
    called = Path(sys.argv[0])
    return called.absolute() if called.name == "relit" and called.is_file() else Path(sys.executable).parent / "relit"


def unit_text(command: Path) -> str:
    """The text of the unit that runs a command, with its checksum line."""
    quoted = str(command).replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    body = UNIT_TEMPLATE.format(command=f'"{quoted}"')
    return f"{CHECKSUM_PREFIX}{_checksum(body)}{CHECKSUM_SUFFIX}{body}"


def is_unmodified(text: str) -> bool:
    """Whether `unit_text` of this or another version wrote the text, and nobody has changed it."""
    stamp, _, body = text.partition("\n")
    return stamp.startswith(CHECKSUM_PREFIX) and stamp.removeprefix(CHECKSUM_PREFIX).startswith(_checksum(body))


def check_service(host: Host) -> Finding:
    """Check that an installed unit starts this installation."""
    topic, path = "service", unit_path()
    if not host.is_linux:
        return ok(topic, "systemd's alone; not on this system")
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return ok(topic, "not installed, relit run is started by hand (relit doctor --fix writes the unit)")
    except OSError as error:
        return warning(topic, f"{path} cannot be read: {error.strerror}", "move it away, then " + FIX_CURE)
    if not is_unmodified(text):
        return ok(topic, f"{path}, changed or written by you")
    if text != unit_text(relit_command()):
        return warning(topic, f"{path} is for another installation or version", FIX_CURE)
    return ok(topic, str(path))


def _checksum(body: str) -> str:
    return sha256(body.encode()).hexdigest()[:12]
