"""The settings as a command sees them: file and environment, with the command line's options on top."""

from __future__ import annotations

import logging
from typing import Any

import typer

from relit_camera.config.load import load_settings
from relit_camera.config.settings import RelitSettings


def settings_of(context: typer.Context, **overrides: Any) -> RelitSettings:
    """Load the settings, and log as they say; `overrides` are nested values, None meaning: not given.

    Raises:
        ConfigError: see `load_settings`.
    """
    given = context.find_root().obj or {}
    settings = load_settings(given.get("config"), {"log_level": given.get("log_level"), **overrides})
    logging.getLogger("relit_camera").setLevel(settings.log_level.upper())
    return settings
