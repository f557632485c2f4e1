"""A face is told from another by its shape."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.app.captures.expressions.identity_check import IdentityTunables, shape_distance_cm, what_differs
from tests.live.people import close_up, face_of


def stranger_points() -> np.ndarray:
    """A face of quite another shape: longer, narrower, with a chin aside."""
    points = face_of(close_up()).head_points.copy()
    points[:, 0] *= np.where(points[:, 1] < -2, 0.75, 1.1)
    points[:, 1] *= 1.12
    return points


def test_shape_difference_is_of_shape_only() -> None:
    face = face_of(close_up())
    points = face.head_points
    assert shape_distance_cm(points, face) == pytest.approx(0, abs=1e-9)
    assert shape_distance_cm(points * 1.3 + [5, -2, 1], face) == pytest.approx(0, abs=1e-6)
    too_near = points * np.stack([1 + 0.02 * points[:, 2], 1 + 0.02 * points[:, 2], np.ones(len(points))], axis=1)
    assert shape_distance_cm(too_near, face) < 0.05  # as a wrong focal length has it
    speaking = points.copy()
    speaking[list(face.scheme.lips)] += [0, -1.5, 0]
    assert shape_distance_cm(speaking, face) == pytest.approx(0, abs=1e-9)
    assert shape_distance_cm(stranger_points(), face) > 0.4


@pytest.mark.parametrize(
    ("shape", "residual", "passes"), [(0.5, 1.9, True), (1.9, 0.5, True), (1.1, 1.1, False), (4.0, 0.2, True)]
)
def test_shape_and_residual_decide_together(shape: float, residual: float, passes: bool) -> None:
    """Each is given in its threshold."""
    limits = IdentityTunables()
    said = what_differs(shape * limits.shape_cm, residual * limits.residual, limits)
    assert (said is None) is passes
    assert said is None or f"{10 * shape * limits.shape_cm:.1f} mm" in said
