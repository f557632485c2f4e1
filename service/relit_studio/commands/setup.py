"""`setup`: Cycles' own environment."""

from __future__ import annotations

import typer

from relit_studio.cycles.cycles_environment import BPY, create_environment


def setup() -> None:
    """Install Cycles (bpy from PyPI, about 1 GB) into an environment of its own in the user's cache."""
    folder = create_environment()
    typer.echo(f"Cycles (bpy {BPY}) is ready in {folder}")
