"""`relit config`: checks the configuration, shows it, and prints its schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True)

ConfigFile = Annotated[Path | None, typer.Argument(help="A YAML file; the usual places if not given.")]


@app.callback()
def group() -> None:
    """Check and show the configuration: defaults < YAML file < RELIT_* environment < command line."""


@app.command()
def check(context: typer.Context, file: ConfigFile = None) -> None:
    """Check the configuration. What is wrong is said with file, line, key and value, and exits with 1."""
    from relit_camera.base.config.access_token import read_token
    from relit_camera.base.config.settings_loader import config_path, load_settings

    chosen = file or (context.find_root().obj or {}).get("config")
    read_token(load_settings(chosen).server)
    path = config_path(chosen)
    typer.echo(f"{path} is right" if path else "there is no configuration file: the defaults hold")


@app.command()
def schema() -> None:
    """Print the JSON schema of the configuration file: every key with its meaning, range and default."""
    import json

    from relit_camera.base.config.settings import RelitSettings

    document = RelitSettings.model_json_schema()
    document["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    typer.echo(json.dumps(document, indent=2))


@app.command()
def show(context: typer.Context) -> None:
    """Print the settings that hold here, as YAML: it can be used as a configuration file."""
    from relit_camera.base.safe_yaml import yaml_text
    from relit_camera.cli.arguments import load_command_settings

    settings = load_command_settings(context).model_dump(mode="json")
    typer.echo(yaml_text(settings), nl=False)
