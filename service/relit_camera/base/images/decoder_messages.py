"""Keeping decoders from writing on the terminal."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator
from pathlib import Path

_lock = threading.Lock()


@contextlib.contextmanager
def suppress_decoder_messages() -> Iterator[None]:
    """Within this block nothing that libpng, OpenCV or OpenEXR say of a damaged file reaches the terminal.

    Their C code writes to file descriptor 2 itself, and OpenEXR prints on `sys.stdout`; we raise one clear error
    instead. Both belong to the whole process: keep only the decoding inside.
    """
    with _lock, Path(os.devnull).open("w") as nowhere, contextlib.ExitStack() as restore:
        restore.enter_context(contextlib.redirect_stdout(nowhere))
        try:
            saved = os.dup(2)
        except OSError:  # a daemon may have closed it: then there is nothing to keep clean
            yield
            return
        restore.callback(os.close, saved)
        restore.callback(os.dup2, saved, 2)
        os.dup2(nowhere.fileno(), 2)
        yield
