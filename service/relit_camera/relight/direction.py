"""A subject under one distant light at an exact direction, not through the 64 x 32 map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import InputError
from relit_camera.reflectance.method import LinearMethod, open_method
from relit_camera.space.images import LinearImage
from relit_camera.subject.subject import Subject


def relight_direction(subject: Subject, direction: NDArray[np.float64]) -> LinearImage:
    """The picture under a light of unit irradiance from `direction` (3,), a unit vector.

    At a captured direction that is the captured frame, as the subject's compression kept it.

    Raises:
        InputError: the subject's method has no value at single directions.
        NotFoundError: the subject's method is not installed.
    """
    method = open_method(subject.metadata.method)
    if not isinstance(method, LinearMethod):
        raise InputError(f"method '{subject.metadata.method}' answers light maps only", "use --environment")
    weights = method.weights(subject.light_directions.astype(np.float64), direction[None, :])
    amounts = subject.light_coefficients @ weights[:, 0]
    return np.asarray(subject.pictures(amounts[:, None])[0])
