"""Keeps environments in little memory: one that is in use as it is, others with panoramas of half the bytes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.environments.environment_panorama import Environment, Panorama
from relit_camera.light.light_map import LightMap

_LARGEST_CODE = np.float32(np.finfo(np.float16).max)


@dataclass(frozen=True, eq=False)
class _PackedEnvironment:
    """An environment whose panorama has floats of 16 bits: its radiance is `codes` times `unit`.

    What is brighter than a billionth of the brightest light is right within a twentieth of a percent. The light map
    stays as it is.
    """

    name: str
    codes: NDArray[np.float16]
    unit: np.float32
    clipped_fraction: float
    panorama_notes: tuple[str, ...]
    light_map: LightMap
    notes: tuple[str, ...]

    def unpacked(self) -> Environment:
        """The environment again."""
        radiance = np.multiply(self.codes, self.unit, dtype=np.float32)
        panorama = Panorama(radiance, self.clipped_fraction, self.panorama_notes)
        return Environment(self.name, panorama, self.light_map, self.notes)


def _packed(environment: Environment) -> _PackedEnvironment:
    panorama = environment.panorama
    radiance = panorama.radiance
    unit = np.maximum(radiance.max() / _LARGEST_CODE, np.finfo(np.float32).tiny)
    codes = np.empty(radiance.shape, np.float16)
    np.divide(radiance, unit, out=codes, dtype=np.float32, casting="same_kind")
    return _PackedEnvironment(
        environment.name,
        codes,
        unit,
        panorama.clipped_fraction,
        panorama.notes,
        environment.light_map,
        environment.notes,
    )


class RecentEnvironments:
    """The environments that were made last, by key. Thread-safe.

    The same object is given again while somebody holds it; afterwards another one, of the packed panorama.
    """

    def __init__(self, most_bytes: int) -> None:
        """`most_bytes` of packed panoramas are kept, and the very last one however large it is."""
        self.most_bytes = most_bytes
        self._used: WeakValueDictionary[Hashable, Environment] = WeakValueDictionary()
        self._kept: dict[Hashable, _PackedEnvironment] = {}
        self._lock = threading.Lock()

    @property
    def nbytes(self) -> int:
        """Bytes of the panoramas that are kept, beside those in use."""
        return sum(packed.codes.nbytes for packed in self._kept.values())

    def get(self, key: Hashable, make: Callable[[], Environment]) -> Environment:
        """The environment of that key, made by `make` where none is kept: twice where two threads ask at once."""
        with self._lock:
            packed = self._kept.pop(key, None)
            if packed is not None:
                self._kept[key] = packed  # as the last
            used = self._used.get(key)
        if used is not None:
            return used
        made = make() if packed is None else packed.unpacked()
        packed = packed or _packed(made)
        with self._lock:
            self._kept[key] = packed
            while len(self._kept) > 1 and self.nbytes > self.most_bytes:
                del self._kept[next(iter(self._kept))]
            return self._used.setdefault(key, made)

    def forget(self, obsolete: Callable[[Hashable], bool]) -> None:
        """Drop what is kept under keys for which `obsolete` is true."""
        with self._lock:
            for key in [key for key in self._kept if obsolete(key)]:
                del self._kept[key]
