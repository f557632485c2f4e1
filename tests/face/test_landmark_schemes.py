from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import NotFoundError
from relit_camera.face.landmarks.canonical_face import canonical_face
from relit_camera.face.landmarks.landmark_schemes import VERTICES_66, LandmarkScheme, landmark_scheme

NAMES = ("mesh478", "openseeface66")


@pytest.fixture(params=NAMES)
def scheme(request: pytest.FixtureRequest) -> LandmarkScheme:
    return landmark_scheme(request.param)


def front_view(scheme: LandmarkScheme, scale: float = 10.0) -> np.ndarray:
    """The canonical face drawn without perspective, y down."""
    return (scheme.canonical[:, :2] * [scale, -scale] + 200).astype(np.float32)


def mirror(scheme: LandmarkScheme, indices: tuple[int, ...]) -> list[int]:
    """The points that lie where these would after mirroring the head."""
    reflected = scheme.canonical[list(indices)] * [-1, 1, 1]
    distances = np.linalg.norm(scheme.canonical[None] - reflected[:, None], axis=2)
    assert distances.min(axis=1).max() < 1e-6
    return distances.argmin(axis=1).tolist()


def test_counts() -> None:
    assert landmark_scheme("mesh478").count == 478
    assert landmark_scheme("openseeface66").count == 66
    assert len(set(VERTICES_66)) == 66


def test_the_mesh_is_the_canonical_face_and_two_irises() -> None:
    scheme = landmark_scheme("mesh478")
    np.testing.assert_array_equal(scheme.canonical[:468], canonical_face().vertices)
    for eye in (scheme.right_eye, scheme.left_eye):
        center, right, upper, left, lower = scheme.canonical[list(eye.iris)]
        corners = scheme.canonical[[eye.outer, eye.inner]]
        np.testing.assert_allclose(center[:2], corners.mean(axis=0)[:2])
        assert right[0] > center[0] > left[0]
        assert upper[1] > center[1] > lower[1]
        assert np.linalg.norm(right - left) == pytest.approx(1.17)  # 11.7 mm


def test_the_nose_tip_is_in_the_middle_and_before_all_else(scheme: LandmarkScheme) -> None:
    tip = scheme.canonical[scheme.nose_tip]
    assert abs(tip[0]) < 1e-6
    assert tip[2] > scheme.canonical[:, 2].max() - 0.1


def test_left_mirrors_right(scheme: LandmarkScheme) -> None:
    right, left = scheme.right_eye, scheme.left_eye
    assert mirror(scheme, (right.outer, right.inner)) == [left.outer, left.inner]
    assert mirror(scheme, right.lids) == list(left.lids)
    assert mirror(scheme, right.gap[0]) == list(left.gap[0])
    assert mirror(scheme, right.gap[1]) == list(left.gap[1])
    assert mirror(scheme, scheme.right_brow) == list(scheme.left_brow)
    for edge in (scheme.upper_lip_outer, scheme.lower_lip_outer, scheme.upper_lip_inner, scheme.lower_lip_inner):
        assert mirror(scheme, edge) == list(reversed(edge))
    assert set(mirror(scheme, scheme.rigid)) == set(scheme.rigid)
    assert set(mirror(scheme, scheme.oval)) == set(scheme.oval)


def test_parts_are_where_they_belong(scheme: LandmarkScheme) -> None:
    points = scheme.canonical
    assert points[scheme.right_eye.outer, 0] < points[scheme.right_eye.inner, 0] < 0
    assert points[list(scheme.right_brow), 1].min() > points[list(scheme.right_eye.lids), 1].max()
    assert points[list(scheme.lips), 1].max() < points[list(scheme.right_eye.lids), 1].min()
    for upper, lower in (scheme.lip_gap, scheme.right_eye.gap, scheme.left_eye.gap):
        assert (points[list(upper), 1] > points[list(lower), 1]).all()


def test_the_oval_runs_clockwise_around_the_lips_and_eyes(scheme: LandmarkScheme) -> None:
    outline = front_view(scheme)[list(scheme.oval)]
    x, y = outline[:, 0], outline[:, 1]
    area = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
    assert area > 0  # clockwise where y points down
    inside = front_view(scheme)[[*scheme.lips, *scheme.eyes]]
    assert (inside.min(axis=0) > outline.min(axis=0)).all()
    assert (inside.max(axis=0) < outline.max(axis=0)).all()


def test_openings_measure_the_gap(scheme: LandmarkScheme) -> None:
    landmarks = front_view(scheme)
    right, left = scheme.eyes_opening(landmarks)
    assert right == pytest.approx(left, rel=1e-4)
    assert 0.2 < right < 0.5
    shut = landmarks.copy()
    shut[list(scheme.right_eye.gap[0])] = shut[list(scheme.right_eye.gap[1])]
    assert scheme.eyes_opening(shut) == (0, pytest.approx(left))
    opened = landmarks.copy()
    upper, lower = scheme.lip_gap
    opened[list(lower)] = opened[list(upper)] + [0, 0.4 * scheme.eye_span(landmarks)]
    assert scheme.mouth_opening(opened) == pytest.approx(0.4, rel=1e-4)


def test_openings_do_not_depend_on_the_size_of_the_picture(scheme: LandmarkScheme) -> None:
    small, large = front_view(scheme, 2.0), front_view(scheme, 40.0)
    assert scheme.mouth_opening(small) == pytest.approx(scheme.mouth_opening(large), rel=1e-3)
    assert scheme.eyes_opening(small) == pytest.approx(scheme.eyes_opening(large), rel=1e-3)


def test_points_in_one_place_have_no_opening(scheme: LandmarkScheme) -> None:
    nothing = np.zeros((scheme.count, 2), np.float32)
    assert scheme.mouth_opening(nothing) == 0
    assert scheme.eyes_opening(nothing) == (0, 0)


def test_eye_centres_are_right_then_left(scheme: LandmarkScheme) -> None:
    right, left = scheme.eye_centers(front_view(scheme))
    np.testing.assert_allclose(scheme.eyes_center(front_view(scheme)), (right + left) / 2, rtol=1e-6)
    assert right[0] < left[0]
    assert right[1] == pytest.approx(left[1])


def test_an_unknown_scheme_is_named() -> None:
    with pytest.raises(NotFoundError, match=r"'ibug68'.*mesh478"):
        landmark_scheme("ibug68")
