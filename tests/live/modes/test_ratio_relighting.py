"""Ratio relighting: only the light is exchanged."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import SubjectError
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.ratio_relighting import (
    RatioReenactor,
    extrapolate_ratio,
    fit_similarity,
    ratio_confidence,
    shape_distance_cm,
)
from relit_camera.live.modes.room_light_estimator import RoomLightEstimate
from relit_camera.live.reenactment.reenactor import open_reenactor
from tests.live.people import NOBODY, close_up, face_of, moved_by, stage_of
from tests.live.rooms import EVENING, WINDOW, before_the_camera, exposure, live_frame, live_picture, still_under


class KnownRoom:
    """A probe that knows the light."""

    def __init__(self, light):
        self.light = light

    def update(self, image, landmarks, rotation, time_s):
        room = self.light * exposure()
        return RoomLightEstimate(room, rotate_light_map(room, rotation), np.ones(3, np.float32), 0.0)


def reenactor(light=None):
    """Ratio relighting of the small person; the room's light is known if given, else measured."""
    image = live_picture(WINDOW)
    ours = open_reenactor("ratio", stage_of(close_up(), (image.shape[1], image.shape[0])))
    assert isinstance(ours, RatioReenactor)
    if light is not None:
        ours._room_light = KnownRoom(light)
    return ours


def inner(picture):
    """The middle of the live picture, where the still is trusted wholly."""
    height, width = picture.shape[:2]
    return picture[height // 5 : -height // 5, width // 5 : -width // 5]


def test_the_rooms_own_light_gives_back_the_live_frame():
    image = live_picture(WINDOW)
    moved = moved_by(reenactor(WINDOW), still_under(WINDOW), before_the_camera(), live_frame(image, 0))
    live = linear_from_uint8(image)
    assert moved.at == (0, 0)
    assert moved.picture.shape == live.shape
    np.testing.assert_array_equal(moved.alpha, 1)
    np.testing.assert_allclose(moved.picture, live, atol=1e-3)


def test_another_light_gives_the_person_in_that_light():
    """Truth: the same person, the same pose, photographed in the other room."""
    image = live_picture(WINDOW)
    moved = moved_by(reenactor(WINDOW), still_under(EVENING), before_the_camera(), live_frame(image, 0))
    truth = linear_from_uint8(live_picture(EVENING))
    unchanged = psnr(inner(linear_from_uint8(image)), inner(truth))
    assert psnr(inner(moved.picture), inner(truth)) > max(24, unchanged + 8)


def test_a_measured_room_does_nearly_as_well():
    image, ours = live_picture(WINDOW), reenactor()
    for step in range(12):
        moved = moved_by(ours, still_under(EVENING), before_the_camera(), live_frame(image, step / 5))
    assert psnr(inner(moved.picture), inner(linear_from_uint8(live_picture(EVENING)))) > 20


@pytest.mark.parametrize("image", [live_picture(WINDOW), np.full_like(live_picture(WINDOW), (253, 180, 150))])
def test_presence_eases_to_the_live_frame_as_it_is_shown(image):
    def shown(presence):
        motion = before_the_camera(presence=presence)
        moved = moved_by(reenactor(WINDOW), still_under(EVENING), motion, live_frame(image, 0))
        return display_from_linear(moved.picture).astype(int)

    np.testing.assert_allclose(shown(0.0), image, atol=1)
    np.testing.assert_allclose(shown(0.5), (shown(1.0) + image) / 2, atol=2)  # skin does not redden on the way


def test_without_a_face_the_live_frame_is_shown():
    image = live_picture(WINDOW)
    moved = moved_by(reenactor(), still_under(EVENING), NOBODY, live_frame(image, 0))
    np.testing.assert_array_equal(moved.picture, linear_from_display(image))  # highlights are not dimmed
    np.testing.assert_array_equal(moved.alpha, 1)


def test_odd_sizes_keep_their_size():
    image = np.ascontiguousarray(live_picture(WINDOW)[:-1, :-3])
    moved = moved_by(reenactor(WINDOW), still_under(WINDOW), before_the_camera(), live_frame(image, 0))
    assert moved.picture.shape == image.shape


def stranger_points():
    """A face of quite another shape: longer, narrower, with a chin aside."""
    points = face_of(close_up()).head_points.copy()
    points[:, 0] *= np.where(points[:, 1] < -2, 0.75, 1.1)
    points[:, 1] *= 1.12
    return points


def test_a_stranger_is_refused_after_a_while():
    noise = np.random.default_rng(2).integers(30, 220, (16, 12, 3)).astype(np.uint8)
    image = np.ascontiguousarray(noise.repeat(16, axis=0).repeat(16, axis=1))
    assert image.shape == live_picture(WINDOW).shape
    ours, stranger = reenactor(), before_the_camera(points=stranger_points())
    moved_by(ours, still_under(WINDOW), stranger, live_frame(image, 0.0))
    for time_s in (0.5, 1.0):
        moved_by(ours, still_under(WINDOW), stranger, live_frame(image, time_s))
    with pytest.raises(SubjectError, match="the live face is not the subject's") as error:
        moved_by(ours, still_under(WINDOW), stranger, live_frame(image, 2.0))
    assert "mode reenact" in error.value.cure


def test_the_person_is_not_refused():
    image, ours = live_picture(WINDOW), reenactor()
    for step in range(16):
        moved_by(ours, still_under(EVENING), before_the_camera(), live_frame(image, step / 5))


def test_shape_difference_is_of_shape_only():
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


def test_a_similarity_is_recovered_and_is_the_least_squares_one():
    rng = np.random.default_rng(6)
    points = rng.random((30, 2)) * 100
    truth = np.array([[0.8 * np.cos(0.4), -0.8 * np.sin(0.4), 7], [0.8 * np.sin(0.4), 0.8 * np.cos(0.4), -3]])
    goal = points @ truth[:, :2].T + truth[:, 2]
    np.testing.assert_allclose(fit_similarity(points, goal), truth, atol=1e-9)
    noisy = goal + rng.normal(0, 2, goal.shape)
    # As a linear system in (a, b, tx, ty): x' = a x − b y + tx, y' = b x + a y + ty.
    ones, zeros = np.ones(30), np.zeros(30)
    system = np.vstack([
        np.column_stack([points[:, 0], -points[:, 1], ones, zeros]),
        np.column_stack([points[:, 1], points[:, 0], zeros, ones]),
    ])  # fmt: skip
    a, b, tx, ty = np.linalg.lstsq(system, noisy.T.ravel(), rcond=None)[0]
    np.testing.assert_allclose(fit_similarity(points, noisy), [[a, -b, tx], [b, a, ty]], atol=1e-9)


def _known_on_a_disc(ratio, shape=(120, 160)):
    y, x = np.mgrid[: shape[0], : shape[1]]
    weight = np.clip(20 - np.hypot(x - 70, y - 60), 0, 4) / 4
    return np.dstack([np.broadcast_to(ratio, (*shape, 3)) * weight[..., None], weight]).astype(np.float32)


@pytest.mark.parametrize("ratio", [[0.2, 0.2, 0.2], [3.0, 1.0, 0.5]])
def test_a_constant_extends_to_that_constant(ratio):
    extension = extrapolate_ratio(_known_on_a_disc(ratio))
    np.testing.assert_allclose(extension, np.broadcast_to(ratio, extension.shape), rtol=0.01)


def test_an_extension_is_smooth_between_what_is_known_and_goes_by_what_is_near():
    warped = _known_on_a_disc([1.0, 1.0, 1.0])
    side = np.where(np.arange(160) < 70, 0.5, 2.0).astype(np.float32)
    warped[..., :3] *= side[None, :, None]
    extension = extrapolate_ratio(warped)[..., 0]
    assert extension.min() >= 0.49
    assert extension.max() <= 2.01
    assert extension[60, 30] < 0.8 < 1.5 < extension[60, 115]
    assert np.abs(np.diff(extension[10])).max() < 0.1


def test_the_rim_is_trusted_less_than_the_middle():
    matte = np.zeros((200, 100), np.float32)
    matte[50:, 20:80] = 1
    weight = ratio_confidence(matte)
    assert weight[100:, 40:60].min() == pytest.approx(1, abs=1e-3)
    assert weight[100, 20] < 0.1
    assert weight[matte == 0].max() < 0.1


def test_nearly_clipped_skin_dims_as_the_light_does():
    """A camera's brightest codes are not taken for more light than they say: red, the first to clip, would glow."""
    image = np.full_like(live_picture(WINDOW), 252)
    moved = moved_by(reenactor(WINDOW), still_under(WINDOW) * 0.5, before_the_camera(), live_frame(image, 0))
    height, width = image.shape[:2]
    middle = moved.picture[int(0.4 * height) : int(0.6 * height), int(0.4 * width) : int(0.6 * width)]
    np.testing.assert_allclose(np.median(middle), 0.5 * linear_from_uint8(np.uint8([252]))[0], rtol=0.1)
