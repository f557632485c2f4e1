"""The seam between samples and field, and how a method is found by name."""

from __future__ import annotations

from functools import partial
from importlib.metadata import entry_points
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import NotFoundError
from relit_camera.capture.reflectance.samples import Samples
from relit_camera.subject.reflectance_field import FactoredField, ReflectanceField

DEFAULT_METHOD = "blend"
ENTRY_POINT_GROUP = "relit_camera.methods"


class ReflectanceMethod(Protocol):
    """Builds a reflectance field from samples."""

    def build(self, samples: Samples) -> ReflectanceField:
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


def factored_field(method: LinearMethod, samples: Samples) -> FactoredField:
    """The field of a linear method (thesis 5.1, 5.2)."""
    return FactoredField(samples.pictures, samples.directions, partial(method.weights, samples.directions))


def method_names() -> list[str]:
    """Names of all installed methods."""
    return sorted(point.name for point in entry_points(group=ENTRY_POINT_GROUP))


def open_method(name: str) -> ReflectanceMethod:
    """The method of that name; `default` is the best there is.

    Raises:
        NotFoundError: none of that name is installed.
    """
    wanted = DEFAULT_METHOD if name == "default" else name
    for point in entry_points(group=ENTRY_POINT_GROUP, name=wanted):
        method: ReflectanceMethod = point.load()()
        return method
    raise NotFoundError(f"no reflectance method '{name}'", f"there are: {', '.join(['default', *method_names()])}")
