"""Suppresses what picture decoders print on the terminal."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

_lock = threading.Lock()


@contextlib.contextmanager
def suppress_decoder_messages() -> Iterator[None]:
    """Within this block nothing that libpng, OpenCV or OpenEXR print about a damaged file reaches the terminal.

    Their C code writes to file descriptor 2, and OpenEXR prints on `sys.stdout`; callers raise one clear error instead.
    Both streams are those of the whole process, so only the decoding itself belongs inside the block.
    """
    with _lock, Path(os.devnull).open("w") as nowhere, contextlib.ExitStack() as restore:
        restore.enter_context(contextlib.redirect_stdout(nowhere))
        try:
            saved = os.dup(2)
        except OSError:  # a background process may have closed it: then nothing is printed
            yield
            return
        restore.callback(os.close, saved)
        restore.callback(os.dup2, saved, 2)
        os.dup2(nowhere.fileno(), 2)
        yield
