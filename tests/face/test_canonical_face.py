from __future__ import annotations

import numpy as np
import pytest

from relit_camera.face.landmarks.canonical_face import canonical_face

RIGHT_EYE, LEFT_EYE, NOSE_TIP, FOREHEAD, CHIN = 33, 263, 4, 10, 152


def test_axes_are_ours() -> None:
    vertices = canonical_face().vertices
    assert vertices[RIGHT_EYE, 0] < 0 < vertices[LEFT_EYE, 0]  # the subject's right eye is at the picture's left
    assert vertices[FOREHEAD, 1] > vertices[NOSE_TIP, 1] > vertices[CHIN, 1]
    assert vertices[NOSE_TIP, 2] == vertices[:, 2].max()  # toward the camera
    assert 8 < np.linalg.norm(vertices[LEFT_EYE] - vertices[RIGHT_EYE]) < 10  # centimetres


def test_triangles_face_outward() -> None:
    face = canonical_face()
    corners = face.vertices[face.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).mean() > 0.95  # all but those inside the mouth and the nostrils
    assert face.triangles.shape == (898, 3)
    assert set(face.triangles.ravel()) == set(range(468))


def test_texture_positions_belong_to_their_vertices() -> None:
    face = canonical_face()
    assert face.uvs.shape == (468, 2)
    assert 0 <= face.uvs.min() < face.uvs.max() <= 1
    assert np.corrcoef(face.uvs[:, 0], face.vertices[:, 0])[0, 1] > 0.95
    assert np.corrcoef(face.uvs[:, 1], face.vertices[:, 1])[0, 1] > 0.95


def test_it_is_shared_and_cannot_be_changed() -> None:
    assert canonical_face() is canonical_face()
    with pytest.raises(ValueError, match="read-only"):
        canonical_face().vertices[0] = 0
