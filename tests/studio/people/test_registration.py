"""The face model finds its way onto a cloud that was made from it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import InputError
from relit_studio.people.face.face_model import IDENTITIES, Part, read_face_model
from relit_studio.people.face.mesh478_points import nearest_on_surface
from relit_studio.people.geometry import Similarity, areas, scatter, vertex_normals
from relit_studio.people.skin.scan_registration import LANDMARKS, fit
from tests.studio.people.tiny_model import tiny_model


def test_a_known_identity_is_recovered() -> None:
    model = tiny_model()
    weights = np.zeros(IDENTITIES)
    weights[:6] = [1.5, -1.2, 1.0, 0.8, -1.0, 0.7]
    truth = model.neutral(weights)
    triangles = model.triangles(Part.FACE)
    where = scatter(triangles, areas(truth, triangles), 20_000, np.random.default_rng(1))
    scan_from_model = Similarity(0.2, Rotation.from_euler("y", 8, degrees=True).as_matrix(), np.array([0.3, 1, -2]))
    points = scan_from_model.apply(where.interpolate(truth))
    normals = where.interpolate(vertex_normals(truth, triangles)) @ scan_from_model.rotation.T
    targets = scan_from_model.apply(truth[model.landmarks68[LANDMARKS]])

    similarity, mesh, distance = fit(model, model.vertices, points, normals, targets, rounds=12)
    # How vertices slide along the surface is only held by landmarks: the surface is what must agree.
    scan_in_model = similarity.apply(scan_from_model.apply(truth))
    before = _apart(model.vertices, truth, triangles)
    # The ridge that keeps heads plausible is strong on so small a mesh.
    assert _apart(mesh, scan_in_model, triangles) < 0.4 * before
    assert distance < 0.15
    assert abs(similarity.scale * 0.2 - 1) < 0.02


def _apart(vertices: Float64Array, surface: Float64Array, triangles: Indices) -> float:
    """Mean distance of inner vertices from a surface."""
    inner = vertices[np.abs(tiny_model().vertices[:, :2]).max(axis=1) < 7]
    nearest = nearest_on_surface(inner, surface, triangles).interpolate(surface)
    return float(np.linalg.norm(nearest - inner, axis=1).mean())


def test_identities_add_up() -> None:
    model = tiny_model()
    weights = np.zeros(IDENTITIES)
    weights[3] = 2
    np.testing.assert_allclose(
        model.neutral(weights), model.vertices + 2 * model.identities[3].astype(float), atol=1e-6
    )


def test_unknown_expressions_are_named() -> None:
    with pytest.raises(InputError, match="no expression 'wink'"):
        tiny_model().displacement({"wink": 1.0})


@pytest.mark.parametrize("data", [b"", b"no archive", b"PK\x03\x04 cut off"])
def test_a_damaged_model_is_said(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "model.npz").write_bytes(data)
    with pytest.raises(InputError, match="no packed face model"):
        read_face_model(tmp_path / "model.npz")
