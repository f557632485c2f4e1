"""The token that clients show where the server can be reached from other machines."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path

from relit_camera.config.settings import ServerSettings
from relit_camera.errors import ConfigError

LEAST_LENGTH = 16
MOST_BYTES = 4096
TOKEN_VARIABLE = "RELIT_SERVER__TOKEN"  # noqa: S105
MAKE_ONE = "make one with: openssl rand -hex 32"

_TOKEN = re.compile(r"[\x21-\x7e]+")
"""What an HTTP header can carry: visible ASCII."""


def read_token(settings: ServerSettings) -> bytes | None:
    """The token that clients must show, or None where none is asked for.

    Raises:
        ConfigError: the server is to be reached from other machines and there is no token; the token's file is
            missing, or may be read by other users; the token is short, or holds what a header cannot carry. The token
            itself is never said.
    """
    if settings.token is not None:
        return _checked(settings.token.get_secret_value(), TOKEN_VARIABLE)
    if settings.token_file is not None:
        return _checked(_read(settings.token_file), str(settings.token_file))
    if not settings.is_loopback:
        raise ConfigError(
            f"'{settings.host}' can be reached from other machines, and there is no token",
            f"name a file with one as server.token_file or set {TOKEN_VARIABLE} ({MAKE_ONE}), or use 127.0.0.1",
        )
    return None


def _read(path: Path) -> str:
    try:
        with path.open("rb") as file:
            if os.name == "posix" and stat.S_IMODE(os.fstat(file.fileno()).st_mode) & 0o077:
                raise ConfigError(f"the token in {path} can be read by other users", f"run: chmod 600 '{path}'")
            return file.read(MOST_BYTES).decode("ascii", "replace").strip()
    except OSError as error:
        raise ConfigError(f"cannot read the token's file {path}: {error.strerror}", MAKE_ONE) from error


def _checked(token: str, place: str) -> bytes:
    if not _TOKEN.fullmatch(token):
        raise ConfigError(f"the token in {place} is empty, or not of visible ASCII characters alone", MAKE_ONE)
    if len(token) < LEAST_LENGTH:
        raise ConfigError(f"the token in {place} has {len(token)} characters, {LEAST_LENGTH} are needed", MAKE_ONE)
    return token.encode("ascii")
