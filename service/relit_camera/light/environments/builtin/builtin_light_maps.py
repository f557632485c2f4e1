"""The light maps of the built-in environments, a file of the package.

Every subject is built with all six in view, and painting their panoramas takes seconds of a processor.
`python -m relit_camera.light.environments.builtin.builtin_light_maps` writes the file.
"""

from __future__ import annotations

import io
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.storage.atomic_files import write_atomic
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment
from relit_camera.light.light_map import LightMap

FILE = Path(__file__).with_name("light_maps.npy")


def builtin_light_map(name: str) -> LightMap:
    """The light map of the built-in environment of that name, which is not painted for it. Read-only.

    Raises:
        KeyError: `name` is none of `BUILTIN_NAMES`.
    """
    if name not in BUILTIN_NAMES:
        raise KeyError(name)
    light_map: LightMap = _all()[BUILTIN_NAMES.index(name)]
    return light_map


def painted_light_maps() -> NDArray[np.float32]:
    """Those of all, (6, 32, 64, 3) in the order of their names, painted anew."""
    return np.stack([builtin_environment(name).light_map for name in BUILTIN_NAMES])


@cache
def _all() -> NDArray[np.float32]:
    maps: NDArray[np.float32] = np.load(FILE, allow_pickle=False)
    maps.flags.writeable = False  # all who ask share it
    return maps


def main() -> None:
    """Write the file."""
    data = io.BytesIO()
    np.save(data, painted_light_maps(), allow_pickle=False)
    write_atomic(FILE, data.getvalue())


if __name__ == "__main__":
    main()
