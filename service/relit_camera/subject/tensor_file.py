"""Arrays in a safetensors file, written whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from relit_camera.files import write_atomic


def write_tensors(path: Path, tensors: Mapping[str, NDArray], header: Mapping[str, str]) -> None:
    """Write arrays of any shape and type, and texts beside them.

    Raises:
        StorageError: the file cannot be written.
    """
    contiguous = {name: np.ascontiguousarray(value) for name, value in tensors.items()}
    # In memory: `save_file` would write beside the target, to a file of its own that a crash leaves behind.
    write_atomic(path, save(contiguous, metadata=dict(header)))
