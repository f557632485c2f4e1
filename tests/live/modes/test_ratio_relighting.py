"""Ratio relighting: only the light is exchanged."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import cv2
import numpy as np
import pytest

from relit_camera.base.config.look import ANYONE
from relit_camera.base.images.color import LUMINANCE, linear_from_uint8
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Points
from relit_camera.base.images.light_multiplication import light_of_root, root_of_light
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import Rotation
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.modes.frame_fitting import fit_motion
from relit_camera.live.modes.frame_relighting import (
    CAST_KEPT,
    MOST_KEPT,
    FacePlan,
    FramePlan,
    FrameRelighting,
    extrapolate_roots,
)
from relit_camera.live.modes.ratio_relighting import (
    BOX_CELLS,
    CASTS,
    FACTORS,
    FaceCells,
    FaceLight,
    RatioRelighting,
    _cells_within,
    bounded_factor,
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


NEUTRAL = np.ones(3, np.float32)


class KnownRoom:
    """Gives a light that is known."""

    def __init__(self, light: LightMap) -> None:
        self.light = light

    def update(self, image: DisplayImage, landmarks: Points, rotation: Rotation, time_s: float) -> RoomLightEstimate:
        room = self.light * exposure()
        return RoomLightEstimate(
            room, partial(rotate_light_map, room), np.ones(3, np.float32), 0.0, np.empty((0, 3), np.float32)
        )


@dataclass
class LivePerson:
    """A person before a camera: what they are relit by, and what tells their room's light."""

    ratio: RatioRelighting
    room: KnownRoom | RoomLightEstimator
    frames: FrameRelighting = field(default_factory=FrameRelighting)


def person(light: LightMap | None = None) -> LivePerson:
    """The small person; the room's light is known if given, else measured."""
    subject, face = close_up(), face_of(close_up())
    ratio = RatioRelighting(subject, face, DenseMotion(SessionOptions("cpu")))
    return LivePerson(ratio, RoomLightEstimator(subject, face) if light is None else KnownRoom(light))


def face_light(
    ratio: RatioRelighting, relit: LinearImage, under_room: LinearImage, motion: FaceMotion, frame: Frame
) -> FaceLight:
    """What the face in a frame tells, whose exposure is that of the pictures."""
    assert motion.pose is not None
    positions = ratio.positions(motion, motion.pose, frame.size)
    pictures = ratio.raised_lights(relit, under_room)
    return FaceLight(NEUTRAL, NEUTRAL, pictures, positions, SCHEME.eye_span(motion.landmarks))


def planned(ratio: RatioRelighting, frame: Frame, light: FaceLight, presence: float = 1.0) -> FramePlan:
    return FramePlan(frame, REST, FacePlan(ratio, light, presence) if presence > 0 else None)


def relit_live(
    ours: LivePerson, relit: LinearImage, motion: FaceMotion, frame: Frame, blend: float = 1.0
) -> DisplayImage:
    """The live frame in the light of a relit picture."""
    room = ours.room.update(frame.image, motion.landmarks, motion.rotation, frame.time_s)
    under_room = relighter().relight(room.in_head_frame(motion.rotation)[None])[0]
    light = replace(face_light(ours.ratio, relit, under_room, motion, frame), gain=room.gain)
    return ours.frames.apply(planned(ours.ratio, frame, light, motion.presence), blend).picture()


def aligned_and_not(image: DisplayImage) -> list[DisplayImage]:
    """A live frame in the light of the evening, without and with its positions corrected; the room's light is known."""
    ratio, motion, frame = person().ratio, before_the_camera(), live_frame(image, 0)
    light = face_light(ratio, still_under(EVENING), still_under(WINDOW), motion, frame)
    lights = (light, ratio.aligned(frame, light, 1.0))
    return [FrameRelighting().apply(planned(ratio, frame, each)).picture() for each in lights]


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
    ratio, motion = person().ratio, before_the_camera()
    frame = live_frame(live_picture(EVENING)[:, ::-1].copy(), 0)
    light = face_light(ratio, still_under(EVENING), still_under(WINDOW), motion, frame)
    before = light.positions.positions
    np.testing.assert_array_equal(ratio.aligned(frame, light, 0.2).positions.positions, before)
    assert np.abs(ratio.aligned(frame, light, 1.0).positions.positions - before).max() > 0.1


def inner(picture: np.ndarray) -> np.ndarray:
    """The middle of the live picture, where the source image is trusted wholly."""
    height, width = picture.shape[:2]
    return picture[height // 5 : -height // 5, width // 5 : -width // 5]


def test_the_rooms_own_light_gives_back_the_live_frame() -> None:
    image = live_picture(WINDOW)
    picture = relit_live(person(WINDOW), still_under(WINDOW), before_the_camera(), live_frame(image, 0))
    np.testing.assert_allclose(picture.astype(int), display_from_linear(linear_from_uint8(image)), atol=1)


def test_another_light_gives_the_person_in_that_light() -> None:
    """Truth: the same person, the same pose, photographed in the other room."""
    image = live_picture(WINDOW)
    picture = relit_live(person(WINDOW), still_under(EVENING), before_the_camera(), live_frame(image, 0))
    truth = linear_from_uint8(live_picture(EVENING))
    unchanged = psnr(inner(linear_from_uint8(image)), inner(truth))
    assert psnr(inner(linear_from_uint8(picture)), inner(truth)) > max(24, unchanged + 8)


@pytest.mark.parametrize("scale", [1, 2])
def test_a_still_person_is_shown_without_a_webcams_noise(scale: int) -> None:
    """Truth: the same person, photographed in the other room without noise."""
    ours, random, relit = person(WINDOW), np.random.default_rng(3), still_under(EVENING)
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
    alone = relit_live(person(WINDOW), relit, motion, live_frame(live[-1], 0))

    def change(pictures: list[DisplayImage]) -> float:
        return float(np.abs(inner(pictures[-1]).astype(float) - inner(pictures[-2])).mean())

    def accuracy(picture: DisplayImage) -> float:
        return psnr(inner(linear_from_uint8(picture)), inner(linear_from_uint8(truth)))

    assert change(shown) < 0.4 * change(live)
    assert accuracy(shown[-1]) > accuracy(alone) + 0.5


def test_a_measured_room_does_nearly_as_well() -> None:
    image, ours = live_picture(WINDOW), person()
    for step in range(12):
        picture = relit_live(ours, still_under(EVENING), before_the_camera(), live_frame(image, step / 5))
    assert psnr(inner(linear_from_uint8(picture)), inner(linear_from_uint8(live_picture(EVENING)))) > 20


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5])
def test_blend_goes_in_light_from_the_live_frame_to_the_relit_one(share: float) -> None:
    image = live_picture(WINDOW)
    image[:20, :20] = np.arange(200, 240, 2, dtype=np.uint8)[:, None]

    def shown(blend: float) -> np.ndarray:
        return relit_live(person(WINDOW), still_under(EVENING), before_the_camera(), live_frame(image, 0), blend)

    live, relit = linear_from_display(image), linear_from_display(shown(1.0))
    expected = display_from_linear(np.asarray(live * (1 - share) + relit * share, np.float32)).astype(int)
    error = np.abs(shown(share).astype(int) - expected)
    assert error.max() <= (1 if share == 0 else 6)  # what highlights are in light is a guess
    assert error[np.maximum(image, shown(1.0)) < 230].max() <= 2


def test_presence_eases_to_the_factor_of_a_person_whose_face_is_not_seen() -> None:
    image = live_picture(WINDOW)

    def shown(presence: float) -> np.ndarray:
        motion = before_the_camera(presence=presence)
        return relit_live(person(WINDOW), still_under(EVENING), motion, live_frame(image, 0)).astype(int)

    at_rest = display_from_linear(linear_from_uint8(image) * REST)
    np.testing.assert_allclose(shown(0.0), at_rest, atol=1)
    between = shown(0.5)
    low, high = np.minimum(at_rest, shown(1.0)), np.maximum(at_rest, shown(1.0))
    assert np.mean((between >= low - 3) & (between <= high + 3)) > 0.98


def test_nobody_followed_is_the_factor_everywhere_and_no_source_image() -> None:
    image = live_picture(WINDOW)
    relit = FrameRelighting().apply(FramePlan(live_frame(image, 0), REST))
    expected = display_from_linear(linear_from_uint8(image) * REST)
    np.testing.assert_allclose(relit.picture().astype(int), expected, atol=1)
    assert relit.person is None


def test_cells_tell_where_the_person_surely_is() -> None:
    ratio, motion, frame = person().ratio, before_the_camera(), live_frame(live_picture(WINDOW), 0)
    light = face_light(ratio, still_under(EVENING), still_under(WINDOW), motion, frame)
    sure = FrameRelighting().apply(planned(ratio, frame, light)).person
    assert sure is not None
    rows, columns = sure.shape
    assert sure[rows // 2, columns // 2] > 0.95
    assert sure[-1].max() < 0.2  # of what goes on beyond the source image it tells nothing


def test_the_mean_factor_is_that_of_the_whole_person() -> None:
    ours = person().ratio
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
    ratio = RatioRelighting(replace(subject, matte=matte), face_of(subject), DenseMotion(SessionOptions("cpu")))
    ours = LivePerson(ratio, KnownRoom(WINDOW))
    frame, motion = live_frame(image, 0), before_the_camera()
    assert motion.pose is not None
    nodes = ratio.positions(motion, motion.pose, frame.size).nodes()
    left, top, right, bottom = _cells_within(nodes, *ratio._near)
    assert 0 < left < right < nodes.shape[1]
    assert 0 < top < bottom < nodes.shape[0]
    assert not any(side % BOX_CELLS for side in (left, top, right, bottom)), "or it would flicker as the person moves"
    few = relit_live(ours, still_under(EVENING), motion, frame).astype(int)
    ratio._near = (-1e9, -1e9), (1e9, 1e9)
    error = np.abs(few - relit_live(LivePerson(ratio, ours.room), still_under(EVENING), motion, frame))
    assert error.mean() < 0.1
    assert error.max() <= 5


@pytest.mark.parametrize("box", [(37, 20, 91, 83), (0, 0, 5, 5), (100, 90, 120, 120), (0, 0, 0, 0)])
def test_a_part_is_what_the_whole_picture_shows_there(box: tuple[int, int, int, int]) -> None:
    ratio, motion, frame = person().ratio, before_the_camera(), live_frame(live_picture(WINDOW), 0)
    light = face_light(ratio, still_under(EVENING), still_under(WINDOW), motion, frame)
    relit = FrameRelighting().apply(planned(ratio, frame, light))
    left, top, right, bottom = box
    part, whole = relit.picture(box), relit.picture()
    np.testing.assert_array_equal(part[top:bottom, left:right], whole[top:bottom, left:right])
    assert (part == frame.image).all(axis=2).mean() > 0.5
    assert (whole == frame.image).all(axis=2).mean() < 0.1


def beside(motion: FaceMotion, left: int, size: tuple[int, int]) -> FaceMotion:
    """The motion of a head that lies so many pixels further right, in a picture of `size` (width, height)."""
    pose = motion.pose
    assert pose is not None
    axis_px = (left + size[0] / 4 - size[0] / 2, 0.0)
    landmarks = motion.landmarks + np.array([left, 0], np.float32)
    return replace(motion, landmarks=landmarks, pose=replace(pose, axis_px=axis_px))


def test_what_is_no_skin_keeps_most_of_the_room_s_color_and_skin_nothing() -> None:
    """The face says that the room is red; a gray sweater that was gray in that room is known not to turn green."""
    ratio, motion = person().ratio, before_the_camera()
    image = live_picture(WINDOW).copy()
    image[-60:] = 120
    frame = live_frame(image, 0)
    light = face_light(ratio, still_under(WINDOW), still_under(WINDOW), motion, frame)
    red = np.array([1.2, 0.95, 0.9], np.float32)
    lights = (light, replace(light, cast=red))
    plain, kept = (FrameRelighting().apply(planned(ratio, frame, each)).factor for each in lights)
    told = light_of_root(np.asarray(kept / plain, np.float32))
    rows, columns = told.shape[:2]
    np.testing.assert_allclose(told[rows // 2, columns // 2], 1, atol=0.01)
    np.testing.assert_allclose(told[-5, columns // 2], red**CAST_KEPT, rtol=0.02)
    strong = replace(light, cast=np.array([3.0, 0.6, 0.3], np.float32))
    most = light_of_root(np.asarray(FrameRelighting().apply(planned(ratio, frame, strong)).factor / plain, np.float32))
    np.testing.assert_allclose(most[-5, columns // 2], np.exp([MOST_KEPT, -MOST_KEPT, -MOST_KEPT]), rtol=0.02)


def test_the_color_that_is_kept_is_eased_as_the_face_is() -> None:
    ratio, motion, frame = person().ratio, before_the_camera(), live_frame(live_picture(WINDOW), 0)
    light = face_light(ratio, still_under(WINDOW), still_under(WINDOW), motion, frame)
    red = replace(light, cast=np.array([1.2, 0.95, 0.9], np.float32))
    for presence, most in ((0.01, 0.01), (1.0, 1.0)):
        plain, kept = (FrameRelighting().apply(planned(ratio, frame, each, presence)).factor for each in (light, red))
        assert np.abs(kept / plain - 1).max() < 0.2 * most


def test_what_others_tell_of_a_frame_before_shows_nothing_of_it() -> None:
    """A further face's cells may be of the last frame: none of its pixels are in this one."""
    subject, motion = close_up(), before_the_camera()
    nobodys = replace(subject, metadata=subject.metadata.model_copy(update={"method": ANYONE}))
    ratio = RatioRelighting(nobodys, face_of(subject), DenseMotion(SessionOptions("cpu")))
    noise = np.random.default_rng(0).integers(-9, 10, live_picture(WINDOW).shape)
    dark, bright = (live_frame(np.clip(code + noise, 0, 255).astype(np.uint8), 0) for code in (30, 220))
    light = face_light(ratio, 8 * still_under(WINDOW), still_under(WINDOW), motion, dark)
    plan = FramePlan(dark, REST, None, (FacePlan(ratio, light, 1.0),))
    frames = FrameRelighting()
    frames.apply(replace(plan, frame=bright))
    np.testing.assert_array_equal(frames.apply(plan).picture(), FrameRelighting().apply(plan).picture())


def test_a_plan_of_the_last_frame_tells_what_it_told_there(monkeypatch: pytest.MonkeyPatch) -> None:
    ratio, motion, frame = person().ratio, before_the_camera(), live_frame(live_picture(WINDOW), 0)
    light = face_light(ratio, still_under(EVENING), still_under(WINDOW), motion, frame)
    asked = []

    def cells(*given: Any) -> FaceCells:
        asked.append(given)
        return RatioRelighting.cells(ratio, *given)

    monkeypatch.setattr(ratio, "cells", cells)
    frames, first, other = FrameRelighting(), FacePlan(ratio, light, 1.0), FacePlan(ratio, light, 0.5)
    one = frames.apply(FramePlan(frame, REST, first, (other,)))
    assert len(asked) == 2
    two = frames.apply(FramePlan(frame, REST, replace(first), (other,)))
    assert len(asked) == 3
    np.testing.assert_array_equal(one.factor, two.factor)


def test_each_of_two_persons_is_relit_by_their_own_face() -> None:
    """Two of the same person side by side, one of them lit from elsewhere; truth: each alone."""
    image, ratio, motion = live_picture(WINDOW), person().ratio, before_the_camera()
    width = image.shape[1]
    both = live_frame(np.hstack([image, image]), 0)
    here, there = (beside(motion, left, both.size) for left in (0, width))
    lights = (
        face_light(ratio, still_under(EVENING), still_under(WINDOW), here, both),
        face_light(ratio, still_under(WINDOW), still_under(WINDOW), there, both),
    )
    first, second = (FacePlan(ratio, each, 1.0) for each in lights)
    shown = FrameRelighting().apply(FramePlan(both, REST, first, (second,))).picture()
    alone = FrameRelighting().apply(FramePlan(both, REST, first)).picture()
    middle = np.s_[:, width + width // 3 : width + 2 * width // 3]
    np.testing.assert_allclose(shown[middle].astype(int), both.image[middle], atol=6)
    assert np.abs(alone[middle].astype(int) - both.image[middle]).mean() > 6, "the other's light is another"
    left = np.s_[:, width // 3 : 2 * width // 3]
    assert np.abs(shown[left].astype(int) - alone[left]).mean() < 0.5


def test_odd_sizes_keep_their_size() -> None:
    image = np.ascontiguousarray(live_picture(WINDOW)[:-1, :-3])
    picture = relit_live(person(WINDOW), still_under(WINDOW), before_the_camera(), live_frame(image, 0))
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
    picture = relit_live(person(WINDOW), scene, before_the_camera(), live_frame(image, 0))
    truth = linear_from_uint8(live_picture(WINDOW)) / 2
    error = np.abs(inner(linear_from_uint8(picture)) - inner(truth)).max(axis=2)
    assert np.mean(error < 0.05) > 0.75  # eyes and lips are the live picture's all the same
    assert np.median(error) < 0.02
