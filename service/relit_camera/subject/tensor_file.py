"""Arrays in a safetensors file, written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import save_file

from relit_camera.files import atomic_path


def write_tensors(path: Path, tensors: Mapping[str, NDArray], header: Mapping[str, str]) -> None:
    """Write arrays of any shape and type, and texts beside them.

    Raises:
        StorageError: the file cannot be written.
    """
    contiguous = {name: np.ascontiguousarray(value) for name, value in tensors.items()}
    with atomic_path(path) as temporary:
        try:
            save_file(contiguous, temporary, metadata=dict(header))
        except SafetensorError as error:
            # The library hides the system's error number in its message.
            if "os error" in str(error).lower() or "I/O" in str(error):
                raise OSError(_errno_in(str(error)), str(error)) from error
            raise


def _errno_in(message: str) -> int:
    return next((code for code in (28, 13, 30, 2) if os.strerror(code).lower() in message.lower()), 5)
