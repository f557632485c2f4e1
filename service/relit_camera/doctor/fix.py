"""`relit doctor --fix`: writes the user's missing files, and lists the commands for everything else.

It changes no file that a person wrote or changed, downloads and starts nothing, and asks for no password. Run twice, it
does nothing the second time.
"""

from __future__ import annotations

import difflib
import os
from contextlib import suppress
from pathlib import Path

from platformdirs import user_config_path

from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import StorageError
from relit_camera.base.models.model_store import models_folder
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_camera.doctor.camera_access import AccessCheck, groups_to_join
from relit_camera.doctor.host import Host
from relit_camera.doctor.kernel_module import needs_module, root_commands
from relit_camera.doctor.models_and_subject import check_models
from relit_camera.doctor.report import FileOutcome, FixedFile, FixResult
from relit_camera.doctor.systemd_unit import is_unmodified, relit_command, unit_path, unit_text

DEFAULT_CONFIG_TEXT = """\
# Relit Camera's settings; what is not here has its default. `relit config schema` lists all of them, `relit config
# check` tells whether this file is right, `relit config show` what is in force.

subject: anyone             # who is shown: a stored subject's name, a .relit file, anyone (whoever comes), null: nobody

source:
  source: webcam            # webcam, a camera's id from `relit devices`, a video or picture file, or pattern
  on_demand: false          # true: the webcam is released while nobody reads the virtual camera or watches a preview

look:
  mode: live                # live: the live picture itself, relit. portrait: the subject's picture, moved as you move
  lighting:
    environment: studio     # studio, window, sunset, night-street, party, overcast, or one of your own
"""


def user_config_file() -> Path:
    """The user's configuration file, which the systemd service reads too."""
    return user_config_path("relit-camera", appauthor=False) / "config.yaml"


def apply_fixes(
    settings: RelitSettings, host: Host, access: AccessCheck = os.access, with_folders: bool = True
) -> FixResult:
    """Write the user's missing files and folders.

    Args:
        settings: of this run; their folders are created.
        host: the machine.
        access: whether this user may access a path: `os.access`, or a test's own.
        with_folders: whether to create folders; not where the configuration has an error and may mean other folders.
    """
    storage = settings.storage
    folders = [storage.subjects, storage.environments, storage.backgrounds, storage.presets, models_folder()]
    files = [*map(_fix_folder, folders if with_folders else []), _fix_config(user_config_file())]
    user_commands = [] if check_models(settings).state == "ok" else ["relit models pull"]
    if host.is_linux:
        files.append(_fix_unit(unit_path()))
        user_commands.append("systemctl --user daemon-reload && systemctl --user enable --now relit-camera")
    lines = root_commands(settings.output, host, groups_to_join(host.tree, access))
    return FixResult(
        files=tuple(files),
        root_commands=lines if needs_module(settings.output, host) else (),
        user_commands=tuple(user_commands),
    )


def _fix_folder(path: Path) -> FixedFile:
    with suppress(OSError):  # without permission to look there is none to write, which `_create` reports
        if path.is_dir():
            return FixedFile(path=str(path), state=FileOutcome.UNCHANGED)
    return _create(path, FileOutcome.WRITTEN, None)


def _fix_config(path: Path) -> FixedFile:
    if os.path.lexists(path):  # the user's own, even if it is a broken link
        return FixedFile(path=str(path), state=FileOutcome.UNCHANGED)
    return _create(path, FileOutcome.WRITTEN, DEFAULT_CONFIG_TEXT)


def _fix_unit(path: Path) -> FixedFile:
    wanted = unit_text(relit_command())
    if not os.path.lexists(path):
        return _create(path, FileOutcome.WRITTEN, wanted)
    try:
        found = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return FixedFile(
            path=str(path), state=FileOutcome.KEPT, note=f"a link to {path.readlink()}, which is not there"
        )
    except OSError as error:
        return FixedFile(path=str(path), state=FileOutcome.FAILED, note=f"cannot read {path}: {error.strerror}")
    if found == wanted:
        return FixedFile(path=str(path), state=FileOutcome.UNCHANGED)
    if not is_unmodified(found):
        diff = difflib.unified_diff(
            found.splitlines(), wanted.splitlines(), str(path), "what --fix would write", "", "", 1, ""
        )
        return FixedFile(path=str(path), state=FileOutcome.KEPT, note="\n".join(diff))
    return _create(path, FileOutcome.RENEWED, wanted)


def _create(path: Path, state: FileOutcome, text: str | None) -> FixedFile:
    """Make a folder, or write a file and the folders above it."""
    try:
        make_folder(path if text is None else path.parent)
        if text is not None:
            write_atomic(path, text)
    except StorageError as error:
        return FixedFile(path=str(path), state=FileOutcome.FAILED, note=str(error))
    return FixedFile(path=str(path), state=state)
