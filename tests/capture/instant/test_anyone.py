"""The head that is nobody's is lit as a head is, alike on both sides, and has one color."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.capture.instant.anyone import SIDE_PX, anyone
from relit_camera.capture.instant.face_selection import SCHEME
from relit_camera.light.directions import direction_from_degrees, texel_directions
from relit_camera.subject.relighting.basis_relighter import BasisRelighter


def lit_from(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    """Luminance under one soft light, (height, width)."""
    toward = texel_directions() @ direction_from_degrees(azimuth_deg, elevation_deg)
    light = np.exp(8 * (toward - 1))[..., None].repeat(3, axis=2).astype(np.float32)
    return np.asarray(BasisRelighter(anyone()).relight(light[None])[0].mean(axis=2))


def test_it_is_nobody_and_made_once() -> None:
    subject = anyone()
    assert subject is anyone()
    assert subject.is_anyone
    assert subject.metadata.rung is None
    assert subject.size == (SIDE_PX, SIDE_PX)


def test_a_light_from_a_side_lights_that_side() -> None:
    right, left = lit_from(80, 0), lit_from(-80, 0)
    middle = SIDE_PX // 2
    face = np.s_[SIDE_PX // 3 : SIDE_PX // 2]
    assert right[face, middle + 4 : middle + 16].mean() > 2 * right[face, middle - 16 : middle - 4].mean()
    mirrored = left[:, ::-1]
    assert np.abs(right - mirrored)[anyone().matte > 0.9].mean() < 0.06 * right.max()


def test_a_light_from_above_leaves_the_neck_in_the_shadow_of_the_chin() -> None:
    lit = lit_from(0, 60)
    points = anyone().landmarks[SCHEME]
    chin, forehead = (points[index].astype(int) for index in (152, 10))
    assert lit[chin[1] + 4 : chin[1] + 8, chin[0]].mean() < 0.6 * lit[forehead[1], forehead[0]]


def test_its_skin_has_one_color_and_the_matte_a_head_on_shoulders() -> None:
    subject = anyone()
    assert subject.albedo is not None
    hull = cv2.convexHull(subject.landmarks[SCHEME].astype(np.float32))
    face = np.zeros(subject.matte.shape, np.uint8)
    cv2.fillConvexPoly(face, hull.astype(np.int32), 1)
    inner = subject.albedo[cv2.erode(face, np.ones((9, 9))) > 0].astype(float)
    assert (inner.std(axis=0) < 0.1 * inner.mean(axis=0)).all()
    assert subject.matte[cv2.erode(face, np.ones((5, 5))) > 0].min() > 0.9
    assert (subject.matte[-1] > 0.5).mean() > 0.8
    assert subject.matte[0].max() == 0
