"""Reflectance methods: what one is (samples → reflectance field), and how one is opened by name.

A plug-in is an entry point of the group `relit_camera.methods`: called without arguments, it gives a
`ReflectanceMethod`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import NotFoundError
from relit_camera.base.plugin_groups import PluginGroup, require_no_argument
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.subject.reflectance_field import FactoredField, ReflectanceField

DEFAULT_METHOD = "blend"


class ReflectanceMethod(Protocol):
    """Builds a reflectance field from samples."""

    def build(self, samples: OlatSamples) -> ReflectanceField:
        """The field.

        Raises:
            LightsError: the directions cannot carry it (too few, or all in one plane).
        """
        ...


@runtime_checkable
class LinearMethod(Protocol):
    """A method whose weights depend on directions alone: it answers any exact direction, not only texels."""

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weight of each captured light at each query direction.

        Args:
            directions: (lights, 3) unit vectors that were captured.
            queries: (count, 3) unit vectors.

        Returns:
            (lights, count) float32; a column sums to 1 in the sampled region, to 0 where nothing was captured.

        Raises:
            LightsError: the directions cannot carry it.
        """
        ...


def factored_field(method: LinearMethod, samples: OlatSamples) -> FactoredField:
    """The field of a linear method (thesis 5.1, 5.2)."""
    return FactoredField(samples.pictures, samples.directions, partial(method.weights, samples.directions))


METHODS: PluginGroup[Callable[[], ReflectanceMethod]] = PluginGroup("relit_camera.methods", "reflectance method")


def method_names() -> list[str]:
    """List the names of all installed methods, sorted."""
    return METHODS.names()


def open_method(name: str) -> ReflectanceMethod:
    """The method of that name; `default` is the best there is.

    Raises:
        NotFoundError: none of that name is installed.
        ConfigError: the plug-in cannot be loaded.
        InputError: the name has an argument (`NAME:ARGUMENT`).
    """
    if name != "default" and not METHODS.has(name):
        there_are = ", ".join(["default", *method_names()])
        raise NotFoundError(f"no reflectance method is called '{name}'", f"there are: {there_are}")
    factory, argument = METHODS.load(DEFAULT_METHOD if name == "default" else name)
    require_no_argument("reflectance method", name.partition(":")[0], argument)
    return factory()
