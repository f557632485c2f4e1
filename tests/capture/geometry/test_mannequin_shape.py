"""The shape of a rendered person against its truth: self-shadowing, gloss, color."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.capture.geometry.shape_estimation import Geometry, estimate_geometry
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View
from relit_studio.mannequin.shape.figure import Posture
from tests.capture.geometry.shapes import angles_deg, front_lights

pytestmark = pytest.mark.slow

SIZE = 64


@pytest.fixture(scope="module")
def view() -> View:
    return View(Posture(), Camera(SIZE))


@pytest.fixture(scope="module")
def skin(view: View) -> np.ndarray:
    """Pixels (64, 64) of skin, wholly covered, not under the chin."""
    whole = (view.matte() > 0.99) & (np.linalg.norm(view.normals(), axis=2) > 0.9)
    return whole & (view.albedo().mean(axis=2) > 0.2)


@pytest.fixture(scope="module")
def found(view: View) -> Geometry:
    directions = front_lights(30, 0.1)
    pictures = np.stack([view.under_light(direction) for direction in directions])
    return estimate_geometry(pictures, directions, view.matte(), Camera(SIZE).focal_px)


def test_normals_of_the_skin(found: Geometry, view: View, skin: np.ndarray) -> None:
    error = angles_deg(found.normals, view.normals(), skin)
    assert error.mean() < 4
    assert np.median(error) < 3


def test_albedo_of_the_skin(found: Geometry, view: View, skin: np.ndarray) -> None:
    ratio = found.albedo[skin] / view.albedo()[skin]
    np.testing.assert_allclose(np.median(ratio, axis=0), 1, atol=0.12)


def test_depth_of_the_face(found: Geometry, view: View, skin: np.ndarray) -> None:
    """To a millimetre and a half over the face; its scale is the camera's."""
    face = skin.copy()
    face[int(SIZE * 0.62) :] = False
    face[:, : SIZE // 3], face[:, -SIZE // 3 :] = False, False
    truth, seen = view.depth()[face], found.depth[face]
    scale, offset = np.polyfit(truth, seen, 1)
    assert scale == pytest.approx(Camera(SIZE).focal_px / 50, rel=0.2)
    assert ((seen - offset) / scale - truth).std() < 0.15


def test_light_not_captured(found: Geometry, view: View, skin: np.ndarray) -> None:
    """Which of its light reaches the skin, against what a picture under it shows."""
    directions = front_lights(11, 0.2)
    pixels = np.flatnonzero(skin)
    cosine = view.normals()[skin] @ directions.T
    expected = view.albedo()[skin].mean(axis=1)[:, None] * np.maximum(cosine, 0)
    pictures = np.stack([view.under_light(direction)[skin].mean(axis=1) for direction in directions], axis=1)
    dark, clear = pictures < 0.3 * expected, cosine > 0.15
    wrong = (found.visible(directions, pixels) == dark)[clear].mean()
    assert dark[clear].mean() > 0.04
    assert wrong < 0.6 * dark[clear].mean()
