"""Radial basis functions over directions: smooth, and nearly exact at the captured ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator

from relit_camera.reflectance.black_ring import region_share
from relit_camera.reflectance.method import factored_field
from relit_camera.reflectance.samples import Samples
from relit_camera.subject.field import FactoredField

SMOOTHING = 1e-4
"""A thousandth of the kernel between lights 15° apart: pictures of nearly one direction are averaged, not resolved."""


@dataclass(frozen=True)
class RadialBasis:
    """Thin-plate splines of the distance between unit vectors, with a linear polynomial.

    The light's cosine with a normal is such a polynomial, and so is reproduced. Beyond the sampled region it fades as
    over the thesis's black ring.
    """

    def build(self, samples: Samples) -> FactoredField:
        """The field; see `Method.build`."""
        return factored_field(self, samples)

    def weights(self, directions: NDArray[np.float64], queries: NDArray[np.float64]) -> NDArray[np.float32]:
        """Weights (lights, queries); see `LinearMethod.weights`."""
        share = region_share(directions, queries)
        one_by_one = np.eye(len(directions))
        spline = RBFInterpolator(directions, one_by_one, smoothing=SMOOTHING, kernel="thin_plate_spline", degree=1)
        return np.asarray((spline(queries) * share[:, None]).T, np.float32)
