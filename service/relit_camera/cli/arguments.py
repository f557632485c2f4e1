"""What commands do with their arguments: load the settings with the options on top, and parse compound values."""

from __future__ import annotations

import logging
import math
from typing import Any

import typer
from pydantic import ValidationError

from relit_camera.base.config.look import (
    Background,
    BlurBackground,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Lighting,
    Mode,
    NoBackground,
)
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.config.settings_loader import load_settings


def load_command_settings(context: typer.Context, **overrides: Any) -> RelitSettings:
    """Load the settings of file, environment and command line, and set the log level that they name.

    Args:
        context: of the command, with the global options.
        overrides: the command's options as nested values; None where an option is not given.

    Raises:
        ConfigError: see `load_settings`.
    """
    given = context.find_root().obj or {}
    settings = load_settings(given.get("config"), {"log_level": given.get("log_level"), **overrides})
    logging.getLogger("relit_camera").setLevel(settings.log_level.upper())
    return settings


def parse_numbers(text: str, count: int, option: str) -> list[float]:
    """Parse `count` finite numbers with commas between.

    Raises:
        typer.BadParameter: another count, or something that is no number (exit 2: usage).
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise typer.BadParameter(f"'{text}' is not {count} numbers with commas between", param_hint=option)
    return values


def parse_background(text: str) -> Background:
    """Parse a background: `none`, `blur`, `environment`, #RRGGBB, or the name of a stored picture.

    Raises:
        typer.BadParameter: the name is not allowed (exit 2: usage).
    """
    kinds: dict[str, Background] = {
        "none": NoBackground(),
        "blur": BlurBackground(),
        "environment": EnvironmentBackground(),
    }
    try:
        if text in kinds:
            return kinds[text]
        return ColorBackground(color=text) if text.startswith("#") else ImageBackground(image=text)
    except ValidationError as error:
        raise typer.BadParameter(error.errors()[0]["msg"], param_hint="--background") from error


def parse_lighting(environment: str, rotate: str, exposure_ev: float) -> Lighting:
    """Make a lighting of an environment's name, its YAW,PITCH,ROLL in degrees, and the exposure.

    Raises:
        typer.BadParameter: not three numbers, or one out of its range (exit 2: usage).
    """
    yaw, pitch, roll = parse_numbers(rotate, 3, "--rotate")
    try:
        return Lighting(environment=environment, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll, exposure_ev=exposure_ev)
    except ValidationError as error:
        first = error.errors()[0]
        raise typer.BadParameter(f"{'.'.join(map(str, first['loc']))}: {first['msg']} (is {first['input']})") from error


def parse_mode(text: str) -> Mode:
    """Parse a mode: `live` or `portrait`, or by its former name.

    Raises:
        typer.BadParameter: neither (exit 2: usage).
    """
    try:
        return Mode(text)
    except ValueError as error:
        raise typer.BadParameter(f"'{text}' is not live or portrait", param_hint="--mode") from error


def parse_size(text: str) -> tuple[int, int]:
    """Parse WIDTHxHEIGHT in pixels.

    Raises:
        typer.BadParameter: not two whole numbers (exit 2: usage).
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise typer.BadParameter(f"'{text}' is not WIDTHxHEIGHT", param_hint="--size")
    return int(width), int(height)
