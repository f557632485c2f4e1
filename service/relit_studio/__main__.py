"""`python -m relit_studio COMMAND`: people, fields, captures and driving videos whose truth is known."""

from __future__ import annotations

import sys

import typer

from relit_camera.base.errors import RelitError
from relit_studio.commands.bundle import bundle
from relit_studio.commands.capture import capture
from relit_studio.commands.check import check
from relit_studio.commands.compare import compare
from relit_studio.commands.drive import drive
from relit_studio.commands.fetch import fetch
from relit_studio.commands.field import field
from relit_studio.commands.learn import learn
from relit_studio.commands.moving import moving
from relit_studio.commands.person import person
from relit_studio.commands.screen import screen
from relit_studio.commands.setup import setup
from relit_studio.commands.sheet import sheet

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Renders people whose truth is known. Begin with `setup` and `fetch`.",
)
for command in (setup, fetch, person, sheet, check, field, screen, compare, capture, drive, moving, learn, bundle):
    app.command()(command)


def main() -> None:
    """Exit with 0: done; 1: the input is at fault, one line on stderr; 2: usage."""
    try:
        app(prog_name="python -m relit_studio")
    except RelitError as error:
        print(f"relit_studio: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
