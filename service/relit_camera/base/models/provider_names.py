"""ONNX Runtime's execution providers by short names, such as `cuda` for `CUDAExecutionProvider`."""

from __future__ import annotations

import contextlib
import io
from functools import cache

from relit_camera.base.errors import ConfigError

AUTO = "auto"
CPU = "cpu"

_PREFERRED = ("cuda",)
"""Providers that `auto` prefers to the CPU if ONNX Runtime was built with them; others are seldom faster here."""


def short_name(provider: str) -> str:
    """Shorten `CUDAExecutionProvider` to `cuda`."""
    name = provider.removesuffix("ExecutionProvider").lower()
    return "directml" if name == "dml" else name


def full_name(provider: str) -> str:
    """Give `CUDAExecutionProvider` for `cuda`.

    Raises:
        ConfigError: ONNX Runtime has no provider of that name on any machine.
    """
    import onnxruntime

    known = {short_name(full): full for full in onnxruntime.get_all_providers()}
    if provider not in known:
        raise ConfigError(f"unknown provider '{provider}'", f"use {', '.join([AUTO, *sorted(known)])}")
    return str(known[provider])


def available_providers() -> list[str]:
    """List what the installed ONNX Runtime was built with; whether one works shows when a session opens on it."""
    import onnxruntime

    return [short_name(provider) for provider in onnxruntime.get_available_providers()]


def choose_provider(requested: str) -> str:
    """Return the short name that `requested` stands for: itself, or for `auto` the best that was built in.

    Raises:
        ConfigError: as `full_name`.
    """
    if requested == AUTO:
        built_in = available_providers()
        return next((provider for provider in _PREFERRED if provider in built_in), CPU)
    full_name(requested)
    return requested


@cache
def preload(provider: str) -> str:
    """Load the libraries of `provider` out of their Python packages; returns what could not be loaded, or ""."""
    if provider != "cuda":
        return ""
    import onnxruntime

    # It prints what it finds; a missing library is no failure yet, since the placement is checked afterwards.
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        onnxruntime.preload_dlls()
    lines = printed.getvalue().strip().splitlines()
    return lines[0] if lines else ""
