"""The command `relit`: finds the module of each command, and prints errors as one line."""

from __future__ import annotations

import errno
import logging
import signal
import sys
import traceback
from enum import StrEnum
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from relit_camera.base.errors import RelitError

COMMANDS = {
    "demo": (
        "relit_camera.cli.commands.demo",
        "Show a bundled person in one place after another, in a page of its own.",
    ),
    "run": (
        "relit_camera.cli.commands.run",
        "Run the camera: webcam in, relit virtual camera out, REST API and panel.",
    ),
    "replay": ("relit_camera.cli.commands.replay", "Relight a recorded video into another video."),
    "track": ("relit_camera.cli.commands.track", "Track the face in a video and write pose and landmarks as JSON."),
    "relight": ("relit_camera.cli.commands.relight", "Relight a subject: one picture under one light."),
    "capture": ("relit_camera.cli.commands.capture", "Build a subject from pictures or video."),
    "subject": ("relit_camera.cli.commands.subject", "Look into subject files."),
    "models": ("relit_camera.cli.commands.models", "List, pull and verify the public models."),
    "devices": ("relit_camera.cli.commands.devices", "List cameras and virtual cameras."),
    "config": ("relit_camera.cli.commands.config", "Check and show the configuration."),
    "bench": ("relit_camera.cli.commands.bench", "Measure relighting and the live pipeline on this machine."),
    "evaluate": (
        "relit_camera.cli.commands.evaluate",
        "Measure fields and relit videos against truth; writes reports.",
    ),
    "doctor": ("relit_camera.cli.commands.doctor", "Find out what keeps the camera from working, and the cure."),
}
"""Command → module with a typer `app`, and its help. A module is imported when its command is called."""


class LogLevel(StrEnum):
    """What `--log-level` takes."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class _LazyGroup(TyperGroup):
    """A command group that imports a command's module only when it is called, so that `relit --help` is fast."""

    _listing = False

    def format_help(self, ctx: Any, formatter: Any) -> None:
        self._listing = True
        super().format_help(ctx, formatter)

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        if cmd_name not in COMMANDS:
            return None
        if self._listing:
            return typer.core.TyperCommand(cmd_name, callback=lambda: None, help=COMMANDS[cmd_name][1])
        command = typer.main.get_command(import_module(COMMANDS[cmd_name][0]).app)
        command.name = cmd_name
        command.help = command.help or COMMANDS[cmd_name][1]
        return command


app = typer.Typer(
    cls=_LazyGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Relit Camera: your face, lit by any place you choose.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from relit_camera import __version__

        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def options(
    context: typer.Context,
    config: Annotated[Path | None, typer.Option(help="Configuration file (YAML).", metavar="FILE")] = None,
    log_level: Annotated[LogLevel | None, typer.Option(help="The least severe messages of the log on stderr.")] = None,
    version: Annotated[bool, typer.Option("--version", callback=_print_version, is_eager=True)] = False,
) -> None:
    """Store the global options for the commands, which load the settings when they need them."""
    context.obj = {"config": config, "log_level": log_level.value if log_level else None}
    # The level holds for Relit Camera's own log; libraries log warnings and errors only.
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    logging.getLogger("relit_camera").setLevel((log_level or LogLevel.WARNING).upper())


def run() -> None:
    """Run the command line. Exit status 0: done; 1: wrong input, a line on stderr; 2: usage. Bugs show a traceback."""
    # On SIGTERM a command cleans up as if it failed; `relit run` has a handler of its own.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        app()
    except RelitError as error:
        print(f"relit: {error}", file=sys.stderr)
        sys.exit(1)
    except BrokenPipeError:
        sys.exit(1)
    except Exception as error:
        from relit_camera.base.plugin_groups import package_at_fault

        if (status := _status_of_end(error)) is not None:
            sys.exit(status)
        if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:  # only a name given by a person causes it
            print(f"relit: cannot use {error.filename}: the name is too long; choose a shorter one", file=sys.stderr)
        elif (package := package_at_fault(error)) is not None:
            traceback.print_exc()
            print(f"relit: this is a fault of the plug-in package {package}: tell its author", file=sys.stderr)
        else:
            raise
        sys.exit(1)


def _status_of_end(error: BaseException) -> int | None:
    """The exit status where the program was told to end in the middle of an import, else None.

    A library that is being imported then (NumPy, ONNX Runtime) says that its import failed: an ImportError whose cause
    is what the signal raised.
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, KeyboardInterrupt):
            return 128 + signal.SIGINT
        if isinstance(cause, SystemExit):
            return cause.code if isinstance(cause.code, int) else 1
        cause = cause.__cause__
    return None
