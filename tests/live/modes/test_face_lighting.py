"""The light on one live face: a head is lit as it stands in the room, however it was captured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.config.look import Look
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.rotations import Rotation, rotation_from_angles
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.light.light_map import LightMap
from relit_camera.live.modes.face_lighting import EASE_S, MOST_TURN_DEG, FaceLighting, LitAs
from relit_camera.live.modes.frame_relighting import FramePlan, FrameRelighting
from relit_camera.live.modes.ratio_relighting import RatioRelighting
from relit_camera.live.modes.room_light_estimator import RoomLightEstimator
from relit_camera.live.modes.scene_relighting import SceneRelighting
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.render_quality import FULL_QUALITY
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer
from tests.live.people import SCHEME, close_up, face_of
from tests.live.rooms import EVENING, LARGER, WINDOW, before_the_camera, exposure, live_frame, live_picture, relighter

SCENE = Scene(Look())


class Evening(LightTransition):
    """The scene's light, in the exposure of the live pictures."""

    def update(self, scene: Scene, now: float) -> LightMap:
        return EVENING * exposure()


def captured(turn: Rotation) -> LitAs:
    """The small person, whose head was turned so when their picture was taken."""
    subject, straight = close_up(), face_of(close_up())
    pose = HeadPose(turn, straight.pose.translation, straight.pose.focal_px)
    landmarks = project(SCHEME.canonical, pose, subject.size)
    subject = replace(subject, landmarks={SCHEME.name: landmarks})
    face = face_of(subject)
    relighting = RatioRelighting(subject, face, DenseMotion(SessionOptions("cpu")))
    return LitAs(subject, face, relighting, RoomLightEstimator(subject, face))


def lighting_of(lit_as: LitAs, at_once: bool = True) -> FaceLighting:
    timer = StageTimer()
    compared = SceneRelighting(lit_as.subject, lit_as.face, relighter(), Evening(), timer)
    return FaceLighting(lit_as, compared, timer, at_once)


def as_in_the_source(lit_as: LitAs, since_neutral: Rotation) -> FaceMotion:
    """The live head stands as it was captured, which is so far from how the person mostly looks into the camera."""
    motion, pose = before_the_camera(since_neutral), lit_as.face.pose
    live = HeadPose(pose.rotation, pose.translation, pose.focal_px * LARGER)
    return replace(motion, landmarks=(lit_as.face.landmarks * LARGER).astype(np.float32), pose=live)


def shown(lit_as: LitAs, motion: FaceMotion) -> DisplayImage:
    """The last of some frames of the person beside the window, in the light of the evening."""
    lighting, frames = lighting_of(lit_as), FrameRelighting()
    for index in range(8):
        frame = live_frame(live_picture(WINDOW), index / 5)
        plan = lighting.update(motion, frame, SCENE, FULL_QUALITY).plan
    return frames.apply(FramePlan(frame, np.ones(3, np.float32), plan)).picture()


def decibels(picture: DisplayImage) -> float:
    """Against the person photographed in the evening's light, in the middle of the picture."""
    height, width = picture.shape[:2]
    inner = np.s_[height // 5 : -height // 5, width // 5 : -width // 5]
    return float(psnr(linear_from_uint8(picture[inner]), linear_from_uint8(live_picture(EVENING)[inner])))


@pytest.mark.parametrize("turn", [rotation_from_angles(28, 0), rotation_from_angles(-15, 15)], ids=["aside", "tilted"])
def test_a_head_that_was_captured_turned_is_lit_as_it_stands(turn: Rotation, monkeypatch: pytest.MonkeyPatch) -> None:
    lit_as = captured(turn)
    motion = as_in_the_source(lit_as, turn)
    right = decibels(shown(lit_as, motion))
    monkeypatch.setattr(SourceFace, "turn_to", lambda self, pose: motion.rotation)
    as_if_captured_straight = decibels(shown(lit_as, motion))
    assert right > 20
    assert right > as_if_captured_straight + 2


def test_what_is_known_of_one_face_s_room_is_not_another_s() -> None:
    lit_as = captured(Rotation.identity())
    motion, frame = as_in_the_source(lit_as, Rotation.identity()), live_frame(live_picture(WINDOW), 0)
    turn = lit_as.face.turn_to(lit_as.face.pose)
    one = lit_as.room_light.fresh()
    seen = one.update(frame.image, motion.landmarks, turn, 0.0)
    other = one.fresh().update(np.full_like(frame.image, 40), motion.landmarks, turn, 0.0)
    again = lit_as.room_light.fresh().update(frame.image, motion.landmarks, turn, 0.0)
    np.testing.assert_array_equal(again.light_map, seen.light_map)
    assert not np.allclose(other.light_map, seen.light_map, rtol=0.2)


def test_a_face_that_comes_later_is_eased_into_its_own_light() -> None:
    lit_as = captured(Rotation.identity())
    motion = as_in_the_source(lit_as, Rotation.identity())
    later, first = lighting_of(lit_as, at_once=False), lighting_of(lit_as)
    frames = [live_frame(live_picture(WINDOW), index / 10) for index in range(12)]
    plans = [later.update(motion, frame, SCENE, FULL_QUALITY).plan for frame in frames]
    assert plans[0] is None
    shares = [plan.presence for plan in plans[1:] if plan is not None]
    assert len(shares) == 11
    assert shares == sorted(shares)
    assert 0 < shares[0] < 0.3
    assert shares[round(10 * EASE_S)] == 1
    at_once = first.update(motion, frames[0], SCENE, FULL_QUALITY).plan
    assert at_once is not None
    assert at_once.presence == 1


def test_in_profile_the_mean_factor_of_before_is_what_is_known() -> None:
    lit_as = captured(Rotation.identity())
    facing = as_in_the_source(lit_as, Rotation.identity())
    assert facing.pose is not None
    aside = replace(facing, pose=replace(facing.pose, rotation=rotation_from_angles(MOST_TURN_DEG + 5)))
    hidden = replace(facing, status=FaceStatus.LOST)
    lighting = lighting_of(lit_as)
    unknown = lighting_of(lit_as).update(aside, live_frame(live_picture(WINDOW), 0), SCENE, FULL_QUALITY)
    assert (unknown.mean, unknown.plan) == (None, None)
    for index in range(4):
        known = lighting.update(facing, live_frame(live_picture(WINDOW), index / 10), SCENE, FULL_QUALITY)
    for index in range(4, 20):
        motion = aside if index < 12 else hidden
        frame = live_frame(np.zeros_like(live_picture(WINDOW)), index / 10)  # nothing that it shows counts
        then = lighting.update(motion, frame, SCENE, FULL_QUALITY)
    assert then.plan is None
    assert known.mean is not None
    assert then.mean is not None
    np.testing.assert_allclose(then.mean, known.mean)
