"""Reads and checks the token that clients need where the server can be reached from other machines."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path

from relit_camera.base.config.settings import ServerSettings
from relit_camera.base.errors import ConfigError

MIN_TOKEN_LENGTH = 16
MAX_TOKEN_FILE_BYTES = 4096
TOKEN_VARIABLE = "RELIT_SERVER__TOKEN"  # noqa: S105
TOKEN_HINT = "make one with: openssl rand -hex 32"  # noqa: S105

_TOKEN_PATTERN = re.compile(r"[\x21-\x7e]+")
"""What an HTTP header can carry: visible ASCII."""


def read_token(settings: ServerSettings) -> bytes | None:
    """The token that clients must send, or None if none is needed.

    Raises:
        ConfigError: the server can be reached from other machines and there is no token; the token's file is missing,
            or may be read by other users; the token is too short, or has characters that no header can carry. The
            message never shows the token.
    """
    if settings.token is not None:
        return _validated(settings.token.get_secret_value(), TOKEN_VARIABLE)
    if settings.token_file is not None:
        return _validated(_read_token_file(settings.token_file), str(settings.token_file))
    if not settings.is_loopback:
        raise ConfigError(
            f"'{settings.host}' can be reached from other machines, and there is no token",
            f"name a file with one as server.token_file or set {TOKEN_VARIABLE} ({TOKEN_HINT}), or use 127.0.0.1",
        )
    return None


def _read_token_file(path: Path) -> str:
    try:
        with path.open("rb") as file:
            if os.name == "posix" and stat.S_IMODE(os.fstat(file.fileno()).st_mode) & 0o077:
                raise ConfigError(f"the token in {path} can be read by other users", f"run: chmod 600 '{path}'")
            return file.read(MAX_TOKEN_FILE_BYTES).decode("ascii", "replace").strip()
    except OSError as error:
        raise ConfigError(f"cannot read the token's file {path}: {error.strerror}", TOKEN_HINT) from error


def _validated(token: str, origin: str) -> bytes:
    if not _TOKEN_PATTERN.fullmatch(token):
        raise ConfigError(f"the token in {origin} is empty, or not of visible ASCII characters alone", TOKEN_HINT)
    if len(token) < MIN_TOKEN_LENGTH:
        raise ConfigError(
            f"the token in {origin} has {len(token)} characters, {MIN_TOKEN_LENGTH} are needed", TOKEN_HINT
        )
    return token.encode("ascii")
