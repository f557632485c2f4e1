"""`fetch`: raw meshes and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relit_studio.base.assets.manifest import manifest
from relit_studio.base.assets.store import assets_folder, fetch_assets
from relit_studio.people.people_assets import people_assets


def fetch(
    mirror: Annotated[Path | None, typer.Option("--from", help="Folder that holds the files.", metavar="DIR")] = None,
) -> None:
    """Get the raw files, verify them, and prepare what all people share (about a minute)."""
    files = fetch_assets(mirror)
    people_assets()
    typer.echo(f"{len(files)} files are ready in {assets_folder()}")
    for credit in manifest().credits.values():
        typer.echo(f"  {credit}")
