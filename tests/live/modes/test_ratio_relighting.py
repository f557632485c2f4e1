"""Ratio relighting: only the light is exchanged."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest

from relit_camera.base.images.color import LUMINANCE, linear_from_uint8
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Points
from relit_camera.base.images.light_multiplication import light_of_root, root_of_light
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import Rotation
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.frame_fitting import fit_motion
from relit_camera.live.modes.ratio_relighting import (
    BOX_CELLS,
    CASTS,
    FACTORS,
    FaceLight,
    RatioPlan,
    RatioRelighting,
    _cells_within,
    bounded_factor,
    extrapolate_roots,
    fit_similarity,
)
from relit_camera.live.modes.room_light_estimator import RoomLightEstimate, RoomLightEstimator
from relit_camera.live.modes.source_masks import NEAR, near_person, ratio_confidence
from relit_camera.live.reenactment.dense_motion import DenseMotion
from tests.live.people import SCHEME, close_up, face_of
from tests.live.rooms import (
    EVENING,
    WINDOW,
    before_the_camera,
    exposure,
    live_frame,
    live_picture,
    relighter,
    still_under,
)

REST = np.array([0.5, 0.4, 0.3], np.float32)
"""A factor for somebody whose face does not tell their light."""


class KnownRoom:
    """Gives a light that is known."""

    def __init__(self, light: LightMap) -> None:
        self.light = light

    def update(self, image: DisplayImage, landmarks: Points, rotation: Rotation, time_s: float) -> RoomLightEstimate:
        room = self.light * exposure()
        return RoomLightEstimate(
            room, partial(rotate_light_map, room), np.ones(3, np.float32), 0.0, np.empty((0, 3), np.float32)
        )


def relighting(light: LightMap | None = None) -> RatioRelighting:
    """Ratio relighting of the small person; the room's light is known if given, else measured."""
    subject, face = close_up(), face_of(close_up())
    room_light = RoomLightEstimator(subject, face) if light is None else KnownRoom(light)
    return RatioRelighting(subject, face, room_light, DenseMotion(SessionOptions("cpu")))


def relit_live(
    ours: RatioRelighting, relit: LinearImage, motion: FaceMotion, frame: Frame, blend: float = 1.0
) -> DisplayImage:
    """The live frame in the light of a relit picture."""
    assert motion.pose is not None
    room = ours.room_light.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
    pictures = ours.raised_lights(relit, relighter().relight(room.in_head_frame(motion.rotation)[None])[0])
    positions = ours.positions(motion, motion.pose, frame.size)
    span = landmark_scheme("mesh478").eye_span(motion.landmarks)
    face = FaceLight(room.gain, pictures, positions, span)
    return ours.apply(RatioPlan(frame, REST, motion.presence, face), blend).image


def aligned_and_not(image: DisplayImage) -> list[DisplayImage]:
    """A live frame in the light of the evening, without and with its positions corrected; the room's light is known."""
    ours, motion, frame = relighting(WINDOW), before_the_camera(), live_frame(image, 0)
    assert motion.pose is not None
    pictures = ours.raised_lights(still_under(EVENING), still_under(WINDOW))
    positions, span = ours.positions(motion, motion.pose, frame.size), SCHEME.eye_span(motion.landmarks)
    plan = RatioPlan(frame, REST, 1.0, FaceLight(np.ones(3, np.float32), pictures, positions, span))
    return [ours.apply(plan).image, ours.apply(ours.aligned(plan)).image]


def test_a_collar_that_sits_elsewhere_is_relit_as_a_collar() -> None:
    """Truth: the same person with the lower part of the picture moved, photographed in the other room."""

    def with_body_moved(image: DisplayImage) -> DisplayImage:
        rows = image.shape[0]
        moved = np.roll(image, 4, axis=1)
        return np.concatenate([image[: 3 * rows // 4], moved[3 * rows // 4 :]])

    truth = with_body_moved(live_picture(EVENING))
    shown = aligned_and_not(with_body_moved(live_picture(WINDOW)))
    lower = np.s_[-truth.shape[0] // 4 + 4 : -4, 12:-12]
    as_guessed, aligned = (psnr(linear_from_uint8(each[lower]), linear_from_uint8(truth[lower])) for each in shown)
    assert aligned > as_guessed + 1


def test_a_person_as_expected_is_relit_as_well_with_alignment() -> None:
    as_guessed, aligned = (
        psnr(inner(linear_from_uint8(each)), inner(linear_from_uint8(live_picture(EVENING))))
        for each in aligned_and_not(live_picture(WINDOW))
    )
    assert aligned > as_guessed - 0.5


def test_noise_is_kept_away_up_to_a_distance_from_the_outline() -> None:
    matte = np.zeros((100, 200), np.float32)
    matte[:, :100] = 1
    near = near_person(matte, 40.0)
    assert near[:, : 100 + 4].min() > 0.95
    assert near[:, 100 + round(1.1 * NEAR * 40) :].max() == 0


def test_every_part_of_the_person_is_near_them() -> None:
    matte = np.zeros((100, 100), np.float32)
    matte[40:44, 10:14] = 1  # less than the neighborhood that makes a point near
    assert np.all(near_person(matte, 40.0) >= matte)


def test_nothing_is_aligned_by_whom_nobody_is_sure_of() -> None:
    ours, motion, frame = relighting(WINDOW), before_the_camera(), live_frame(live_picture(EVENING)[:, ::-1].copy(), 0)
    assert motion.pose is not None
    pictures = ours.raised_lights(still_under(EVENING), still_under(WINDOW))
    positions, span = ours.positions(motion, motion.pose, frame.size), SCHEME.eye_span(motion.landmarks)
    plan = RatioPlan(frame, REST, 0.2, FaceLight(np.ones(3, np.float32), pictures, positions, span))
    np.testing.assert_array_equal(corrected(ours, plan), positions.positions)
    assert np.abs(corrected(ours, replace(plan, presence=1.0)) - positions.positions).max() > 0.1


def corrected(ours: RatioRelighting, plan: RatioPlan) -> np.ndarray:
    """The positions of a plan once it is aligned."""
    face = ours.aligned(plan).face
    assert face is not None
    return face.positions.positions


def inner(picture: np.ndarray) -> np.ndarray:
    """The middle of the live picture, where the source image is trusted wholly."""
    height, width = picture.shape[:2]
    return picture[height // 5 : -height // 5, width // 5 : -width // 5]


def test_the_rooms_own_light_gives_back_the_live_frame() -> None:
    image = live_picture(WINDOW)
    picture = relit_live(relighting(WINDOW), still_under(WINDOW), before_the_camera(), live_frame(image, 0))
    np.testing.assert_allclose(picture.astype(int), display_from_linear(linear_from_uint8(image)), atol=1)


def test_another_light_gives_the_person_in_that_light() -> None:
    """Truth: the same person, the same pose, photographed in the other room."""
    image = live_picture(WINDOW)
    picture = relit_live(relighting(WINDOW), still_under(EVENING), before_the_camera(), live_frame(image, 0))
    truth = linear_from_uint8(live_picture(EVENING))
    unchanged = psnr(inner(linear_from_uint8(image)), inner(truth))
    assert psnr(inner(linear_from_uint8(picture)), inner(truth)) > max(24, unchanged + 8)


@pytest.mark.parametrize("scale", [1, 2])
def test_a_still_person_is_shown_without_a_webcams_noise(scale: int) -> None:
    """Truth: the same person, photographed in the other room without noise."""
    ours, random, relit = relighting(WINDOW), np.random.default_rng(3), still_under(EVENING)
    image, truth = (
        cv2.resize(live_picture(light), None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        for light in (WINDOW, EVENING)
    )
    motion = fit_motion(before_the_camera(), live_picture(WINDOW).shape[1::-1], image.shape[1::-1])
    live, shown = list[DisplayImage](), list[DisplayImage]()
    for step in range(16):
        noise = 4 * random.standard_normal(image.shape)
        live.append(np.clip(np.rint(image + noise), 0, 255).astype(np.uint8))
        shown.append(relit_live(ours, relit, motion, live_frame(live[-1], step / 5)))
    alone = relit_live(relighting(WINDOW), relit, motion, live_frame(live[-1], 0))

    def change(pictures: list[DisplayImage]) -> float:
        return float(np.abs(inner(pictures[-1]).astype(float) - inner(pictures[-2])).mean())

    def accuracy(picture: DisplayImage) -> float:
        return psnr(inner(linear_from_uint8(picture)), inner(linear_from_uint8(truth)))

    assert change(shown) < 0.4 * change(live)
    assert accuracy(shown[-1]) > accuracy(alone) + 0.5


def test_a_measured_room_does_nearly_as_well() -> None:
    image, ours = live_picture(WINDOW), relighting()
    for step in range(12):
        picture = relit_live(ours, still_under(EVENING), before_the_camera(), live_frame(image, step / 5))
    assert psnr(inner(linear_from_uint8(picture)), inner(linear_from_uint8(live_picture(EVENING)))) > 20


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_blend_goes_in_light_from_the_live_frame_to_the_relit_one(share: float) -> None:
    image = live_picture(WINDOW)
    image[:20, :20] = np.arange(200, 240, 2, dtype=np.uint8)[:, None]

    def shown(blend: float) -> np.ndarray:
        return relit_live(relighting(WINDOW), still_under(EVENING), before_the_camera(), live_frame(image, 0), blend)

    live, relit = linear_from_display(image), linear_from_display(shown(1.0))
    expected = display_from_linear(np.asarray(live * (1 - share) + relit * share, np.float32)).astype(int)
    error = np.abs(shown(share).astype(int) - expected)
    assert error.max() <= (1 if share == 0 else 6)  # what highlights are in light is a guess
    assert error[np.maximum(image, shown(1.0)) < 230].max() <= 2


def test_presence_eases_to_the_factor_of_a_person_whose_face_is_not_seen() -> None:
    image = live_picture(WINDOW)

    def shown(presence: float) -> np.ndarray:
        motion = before_the_camera(presence=presence)
        return relit_live(relighting(WINDOW), still_under(EVENING), motion, live_frame(image, 0)).astype(int)

    at_rest = display_from_linear(linear_from_uint8(image) * REST)
    np.testing.assert_allclose(shown(0.0), at_rest, atol=1)
    between = shown(0.5)
    low, high = np.minimum(at_rest, shown(1.0)), np.maximum(at_rest, shown(1.0))
    assert np.mean((between >= low - 3) & (between <= high + 3)) > 0.98


def test_nobody_followed_is_the_factor_everywhere_and_no_source_image() -> None:
    image = live_picture(WINDOW)
    relit = relighting(WINDOW).apply(RatioPlan(live_frame(image, 0), REST))
    np.testing.assert_allclose(relit.image.astype(int), display_from_linear(linear_from_uint8(image) * REST), atol=1)
    assert relit.person is None


def test_cells_tell_where_the_person_surely_is() -> None:
    ours, motion, frame = relighting(WINDOW), before_the_camera(), live_frame(live_picture(WINDOW), 0)
    assert motion.pose is not None
    pictures = ours.raised_lights(still_under(EVENING), still_under(WINDOW))
    positions = ours.positions(motion, motion.pose, frame.size)
    face = FaceLight(np.ones(3, np.float32), pictures, positions, SCHEME.eye_span(motion.landmarks))
    person = ours.apply(RatioPlan(frame, REST, 1.0, face)).person
    assert person is not None
    rows, columns = person.shape
    assert person[rows // 2, columns // 2] > 0.95
    assert person[-1].max() < 0.2  # of what goes on beyond the source image it tells nothing


def test_the_mean_factor_is_that_of_the_whole_person() -> None:
    ours = relighting(WINDOW)
    pictures = ours.raised_lights(still_under(WINDOW) * np.array([0.8, 1.0, 1.3], np.float32), still_under(WINDOW))
    np.testing.assert_allclose(ours.mean_factor(pictures, np.ones(3, np.float32)), [0.8, 1.0, 1.3], rtol=0.04)
    doubled = ours.mean_factor(pictures, np.full(3, 2, np.float32))
    np.testing.assert_allclose(doubled, [0.4, 0.5, 0.65], rtol=0.04)  # the frame is exposed twice as long


@pytest.mark.parametrize("factor", [[40.0, 2.0, 1.0], [0.01, 0.01, 0.01], [0.0, 0.0, 5.0]])
def test_a_factor_of_somebody_who_was_misread_is_bounded(factor: list[float]) -> None:
    found = bounded_factor(np.array(factor))
    level = float(found @ LUMINANCE)
    assert FACTORS[0] * CASTS[0] - 1e-6 <= found.min() <= found.max() <= FACTORS[1] * CASTS[1] + 1e-6
    assert found.max() / max(level, 1e-6) < 2.5


def test_a_factor_within_the_bounds_stays() -> None:
    np.testing.assert_allclose(bounded_factor(np.array([0.8, 0.7, 0.5])), [0.8, 0.7, 0.5], rtol=1e-6)


def test_what_is_made_for_the_person_s_cells_alone_is_what_all_cells_would_give() -> None:
    subject, image = close_up(), live_picture(WINDOW)
    matte = np.zeros_like(subject.matte)
    height, width = matte.shape
    cv2.ellipse(matte, (width // 2, height // 2), (width // 8, height // 6), 0, 0, 360, 1.0, -1)
    ours = RatioRelighting(
        replace(subject, matte=matte),
        face_of(subject),
        KnownRoom(WINDOW),
        DenseMotion(SessionOptions("cpu")),
    )
    frame, motion = live_frame(image, 0), before_the_camera()
    assert motion.pose is not None
    nodes = ours.positions(motion, motion.pose, frame.size).nodes()
    left, top, right, bottom = _cells_within(nodes, *ours._near)
    assert 0 < left < right < nodes.shape[1]
    assert 0 < top < bottom < nodes.shape[0]
    assert not any(side % BOX_CELLS for side in (left, top, right, bottom)), "or it would flicker as the person moves"
    few = relit_live(ours, still_under(EVENING), motion, frame).astype(int)
    ours._near = (-1e9, -1e9), (1e9, 1e9)
    error = np.abs(few - relit_live(ours, still_under(EVENING), motion, frame))
    assert error.mean() < 0.1
    assert error.max() <= 5


def test_odd_sizes_keep_their_size() -> None:
    image = np.ascontiguousarray(live_picture(WINDOW)[:-1, :-3])
    picture = relit_live(relighting(WINDOW), still_under(WINDOW), before_the_camera(), live_frame(image, 0))
    assert picture.shape == image.shape


def test_a_similarity_is_recovered_and_is_the_least_squares_one() -> None:
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


def _known_on_a_disc(ratio: list[float], shape: tuple[int, int] = (120, 160)) -> np.ndarray:
    y, x = np.mgrid[: shape[0], : shape[1]]
    weight = np.clip(20 - np.hypot(x - 70, y - 60), 0, 4) / 4
    roots = root_of_light(np.broadcast_to(ratio, (*shape, 3)).astype(np.float32))
    return np.dstack([roots * weight[..., None], weight]).astype(np.float32)


@pytest.mark.parametrize("ratio", [[0.2, 0.2, 0.2], [3.0, 1.0, 0.5]])
def test_a_constant_extends_to_that_constant(ratio: list[float]) -> None:
    extension = light_of_root(extrapolate_roots(_known_on_a_disc(ratio)))
    np.testing.assert_allclose(extension, np.broadcast_to(ratio, extension.shape), rtol=0.01)


def test_an_extension_is_smooth_between_what_is_known_and_goes_by_what_is_near() -> None:
    warped = _known_on_a_disc([1.0, 1.0, 1.0])
    side = np.where(np.arange(160) < 70, 0.5, 2.0).astype(np.float32)
    warped[..., :3] *= root_of_light(side[None])[0][None, :, None]
    extension = light_of_root(extrapolate_roots(warped))[..., 0]
    assert extension.min() >= 0.49
    assert extension.max() <= 2.01
    assert extension[60, 30] < 0.8 < 1.5 < extension[60, 115]
    assert np.abs(np.diff(extension[10])).max() < 0.1


def test_the_rim_is_trusted_less_than_the_middle() -> None:
    matte = np.zeros((200, 100), np.float32)
    matte[50:, 20:80] = 1
    weight = ratio_confidence(matte)
    assert weight[100:180, 40:60].min() == pytest.approx(1, abs=1e-3)
    assert weight[-1].max() < 0.05  # the body goes on below, and of that the picture tells nothing
    assert weight[100, 20] < 0.1
    assert weight[matte == 0].max() < 0.1


def test_overexposed_skin_is_shown_as_the_source_image_has_it() -> None:
    """Nothing of it is in the live picture: multiplied, it would glow red, the first color to be cut off."""
    image, scene = np.full_like(live_picture(WINDOW), 255), still_under(WINDOW) * np.float32(0.5)
    picture = relit_live(relighting(WINDOW), scene, before_the_camera(), live_frame(image, 0))
    truth = linear_from_uint8(live_picture(WINDOW)) / 2
    error = np.abs(inner(linear_from_uint8(picture)) - inner(truth)).max(axis=2)
    assert np.mean(error < 0.05) > 0.75  # eyes and lips are the live picture's all the same
    assert np.median(error) < 0.02
