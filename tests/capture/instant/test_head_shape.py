"""A generic head: the face is where the landmarks are, and where the parts meet nothing throws a shadow."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.capture.instant.head_shape import HeadShape, fit_head_shape
from relit_camera.capture.instant.surface_raster import raster_mesh, vertex_normals
from relit_camera.capture.reflectance.appearance_model import direct_light_fractions
from relit_camera.face.landmarks.canonical_face import canonical_face
from relit_camera.light.directions import direction_from_degrees
from tests.capture.instant.canonical_person import (
    PIXELS_PER_CM,
    SIZE,
    canonical_landmarks,
    canonical_pose,
    person_matte,
)


@pytest.fixture(scope="module")
def head() -> HeadShape:
    return fit_head_shape(canonical_landmarks(canonical_pose()), person_matte())


def pixel(x_cm: float, y_cm: float) -> tuple[int, int]:
    """Row and column of a point of the head, in parallel projection."""
    return round(SIZE / 2 - y_cm * PIXELS_PER_CM), round(SIZE / 2 + x_cm * PIXELS_PER_CM)


def lit(head: HeadShape, azimuth: float, elevation: float) -> np.ndarray:
    """Share of a lamp's light that reaches each pixel (SIZE, SIZE)."""
    light = direction_from_degrees([azimuth], [elevation])
    return direct_light_fractions(head.geometry, light, np.arange(SIZE * SIZE)).reshape(SIZE, SIZE)


def test_a_ball_is_seen_as_a_ball() -> None:
    """The rasterizer, on a sphere of triangles: depth and normals are the formula's."""
    angles = np.linspace(0, np.pi, 33), np.linspace(0, 2 * np.pi, 64, endpoint=False)
    polar, around = (each.ravel() for each in np.meshgrid(*angles, indexing="ij"))
    unit = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=1)
    index = np.arange(32)[:, None] * 64 + np.arange(64)
    right = np.arange(32)[:, None] * 64 + (np.arange(64) + 1) % 64
    quads = np.stack([index, right, right + 64, index + 64], axis=-1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    normals = vertex_normals(unit, triangles)
    normals *= np.sign((normals * unit).sum(axis=1))[:, None]
    pixels = unit * [30, -30, 30] + [32, 32, 0]
    depth, values = raster_mesh(pixels, triangles, normals, (64, 64))
    x, y = (np.mgrid[:64, :64][::-1] + 0.5 - 32) / 30
    inside = np.hypot(x, y) < 0.9
    expected = np.sqrt(1 - (x**2 + y**2)[inside])
    np.testing.assert_allclose(depth[inside] / 30, expected, atol=0.01)
    np.testing.assert_allclose(values[inside], np.stack([x[inside], -y[inside], expected], axis=1), atol=0.03)
    assert np.isnan(depth[np.hypot(x, y) > 1.05]).all()


def test_the_face_is_the_canonical_face(head: HeadShape) -> None:
    """Depth between points on it, and where it is."""
    vertices = canonical_face().vertices
    assert head.pixels_per_cm == pytest.approx(PIXELS_PER_CM, rel=0.01)
    for name, first, second in (("nose", 4, 10), ("nose over lips", 1, 17), ("cheek", 50, 280), ("brow", 9, 4)):
        depths = [head.geometry.depth[pixel(*vertices[each, :2])] for each in (first, second)]
        expected = vertices[first, 2] - vertices[second, 2]
        assert (depths[0] - depths[1]) / PIXELS_PER_CM == pytest.approx(expected, abs=0.7), name
    assert head.face[pixel(0, 0)]
    assert not head.face[pixel(0, 11)]
    eye, cheek = vertices[159], vertices[50]
    assert head.skin[pixel(*cheek[:2])]
    assert not head.skin[pixel(*eye[:2])]


def test_it_is_as_even_as_the_face(head: HeadShape) -> None:
    mirrored = head.geometry.normals[:, ::-1] * [-1, 1, 1]
    body = (person_matte() > 0.5) & (person_matte()[:, ::-1] > 0.5)
    assert np.degrees(np.arccos(np.clip((mirrored * head.geometry.normals).sum(axis=-1)[body], -1, 1))).mean() < 3


def test_no_band_across_the_forehead(head: HeadShape) -> None:
    """Where the mesh ends, light from above, below and ahead passes, and the surface goes on without a kink."""
    rows = slice(pixel(0, 11)[0], pixel(0, 6)[0])
    columns = slice(pixel(-4, 0)[1], pixel(4, 0)[1])
    for elevation in (0, 45, 70):
        assert lit(head, 0, elevation)[rows, columns].min() > 0.9
    normals = head.geometry.normals[rows, columns]
    bends = np.degrees(np.arccos(np.clip((normals[1:] * normals[:-1]).sum(axis=-1), -1, 1)))
    assert bends.max() < 8


def test_the_chin_shades_the_neck_and_the_nose_the_lip(head: HeadShape) -> None:
    above = lit(head, 0, 65)
    assert above[pixel(0, -11.5)] < 0.3
    assert above[pixel(0, -8)] > 0.7
    assert lit(head, 0, 0)[pixel(0, -11.5)] > 0.9
    assert lit(head, 0, 75)[pixel(0, -2.2)] < lit(head, 0, 20)[pixel(0, -2.2)] - 0.3


def test_a_turned_head_is_turned() -> None:
    pose = canonical_pose(yaw_deg=20)
    turned = fit_head_shape(canonical_landmarks(pose), person_matte())
    forehead = np.median(turned.geometry.normals[pixel(0, 7)[0], SIZE // 2 - 3 : SIZE // 2 + 4], axis=0)
    assert np.degrees(np.arctan2(forehead[0], forehead[2])) > 0
    straight = fit_head_shape(canonical_landmarks(canonical_pose()), person_matte())
    nose = [np.nanargmax(np.where(each.face, each.geometry.depth, np.nan)) % SIZE for each in (straight, turned)]
    assert nose[1] - nose[0] > 1.5 * PIXELS_PER_CM


def test_where_the_matte_has_nobody_it_says_so() -> None:
    with pytest.raises(CaptureError, match="matte"):
        fit_head_shape(canonical_landmarks(canonical_pose()), np.zeros((SIZE, SIZE), np.float32))


def test_landmarks_of_no_head_are_refused() -> None:
    with pytest.raises(CaptureError, match="no head pose"):
        fit_head_shape(np.full((478, 2), np.nan, np.float32), person_matte())
