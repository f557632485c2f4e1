"""What is told of a person before the webcam: each thing that matters, made worse until it is said."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import cv2
import numpy as np
import pytest

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.framing.framing import FaceCount, Framing, FramingState
from relit_camera.face.framing.framing_judge import judge_framing, sharpness

SIZE = (640, 360)
ALL = ("distance", "position", "light", "sharpness", "exposure")


def detection(x: float, y: float, height: float) -> Detection:
    """A face of that middle and height, in parts of the picture's width and height."""
    tall = height * SIZE[1]
    wide = 0.75 * tall
    box = (x * SIZE[0] - wide / 2, y * SIZE[1] - tall / 2, wide, tall)
    return Detection(box, np.zeros((2, 2), np.float32), 0.9)


def person(face: Detection, level: float = 150.0, room: float = 110.0, side: float = 1.0) -> DisplayImage:
    """A room with a face that has texture; the right half of the face is brighter by `side`, in linear light."""
    width, height = SIZE
    picture = np.full((height, width), room, np.float32)
    left, top, wide, tall = face.box
    y, x = np.mgrid[:height, :width]
    inside = ((x - left - wide / 2) / (0.62 * wide)) ** 2 + ((y - top - tall / 2) / (0.62 * tall)) ** 2 < 1
    texture = 1 + 0.25 * np.sin(x * 12 / wide * 2 * np.pi) * np.sin(y * 12 / tall * 2 * np.pi)
    shade = 1.1 - 0.3 * ((y - top) / tall)
    lit = level * shade * texture * np.where(x > left + wide / 2, side ** (1 / 2.2), 1.0)
    picture = np.where(inside, lit, picture)
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


MIDDLE = detection(0.5, 0.5, 0.4)


def states(framing: Framing) -> dict[str, str]:
    return {name: str(getattr(framing, name).state) for name in ALL}


def judged(face: Detection = MIDDLE, light: Mapping[str, float] = MappingProxyType({})) -> Framing:
    return judge_framing(person(face, **light), [face])


def test_a_person_in_the_middle_of_an_even_room_has_nothing_to_do() -> None:
    framing = judged()
    assert framing.face is FaceCount.ONE
    assert states(framing) == dict.fromkeys(ALL, "good")
    assert framing.is_good
    assert framing.box == pytest.approx((0.5 - 0.3 * 0.4 * 360 / 640 / 0.8, 0.3, 0.75 * 0.4 * 360 / 640, 0.4))


@pytest.mark.parametrize(
    ("face", "name", "state"),
    [
        (detection(0.5, 0.5, 0.12), "distance", FramingState.FAR),
        (detection(0.5, 0.6, 0.75), "distance", FramingState.NEAR),
        (detection(0.85, 0.5, 0.3), "position", FramingState.OFF_CENTER),
        (detection(0.15, 0.5, 0.3), "position", FramingState.OFF_CENTER),
        (detection(0.5, 0.2, 0.38), "position", FramingState.OFF_CENTER),  # the hair is cut off
        (detection(0.5, 0.9, 0.3), "position", FramingState.OFF_CENTER),
    ],
)
def test_where_the_face_is(face: Detection, name: str, state: FramingState) -> None:
    framing = judged(face)
    assert getattr(framing, name).state is state
    assert framing.advice == getattr(framing, name).advice
    assert framing.advice.endswith(".")


@pytest.mark.parametrize(
    ("light", "name", "state"),
    [
        ({"level": 40.0, "room": 30.0}, "exposure", FramingState.DARK),
        ({"level": 290.0}, "exposure", FramingState.BRIGHT),
        ({"level": 110.0, "side": 4.0}, "light", FramingState.ONE_SIDED),
        ({"level": 190.0, "side": 0.25}, "light", FramingState.ONE_SIDED),
        ({"level": 85.0, "room": 250.0}, "light", FramingState.BACKLIT),
    ],
)
def test_how_it_is_lit(light: dict[str, float], name: str, state: FramingState) -> None:
    framing = judged(light=light)
    assert states(framing) == dict.fromkeys(ALL, "good") | {name: str(state)}
    assert framing.advice == getattr(framing, name).advice


@pytest.mark.parametrize("light", [{"side": 1.8}, {"room": 180.0}, {"room": 30.0}, {"level": 95.0}, {"level": 200.0}])
def test_ordinary_rooms_are_good(light: dict[str, float]) -> None:
    assert judged(light=light).is_good


@pytest.mark.parametrize("contrast", [1.0, 0.4])
def test_a_blurred_face_is_told_whatever_its_contrast_and_size(contrast: float) -> None:
    for height in (0.4, 0.6):
        face = detection(0.5, 0.55, height)
        picture = person(face)
        picture = (130 + contrast * (picture.astype(np.float32) - 130)).astype(np.uint8)
        assert judge_framing(picture, [face]).sharpness.state is FramingState.GOOD
        blurred = np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.075 * face.box[2]), np.uint8)
        assert judge_framing(blurred, [face]).sharpness.state is FramingState.BLURRED


def test_sharpness_has_no_unit() -> None:
    grey = person(MIDDLE)[..., 0]
    assert sharpness((grey // 2).astype(np.uint8)) == pytest.approx(sharpness(grey), rel=0.2)
    assert sharpness(np.full((8, 8), 90, np.uint8)) == 0.0


def test_nobody_and_several() -> None:
    nobody = judge_framing(person(MIDDLE), [])
    assert nobody.face is FaceCount.NONE
    assert set(states(nobody).values()) == {"unknown"}
    assert nobody.box is None
    assert "No face" in nobody.advice
    two = judge_framing(person(MIDDLE), [detection(0.2, 0.5, 0.3), MIDDLE])
    assert two.face is FaceCount.SEVERAL
    assert "several" in two.advice
    far_behind = judge_framing(person(MIDDLE), [detection(0.1, 0.3, 0.1), MIDDLE])
    assert far_behind.face is FaceCount.ONE
    assert far_behind.is_good


@pytest.mark.parametrize("box", [(-50.0, -50.0, 40.0, 40.0), (630.0, 350.0, 300.0, 300.0), (10.0, 10.0, 0.5, 0.5)])
def test_a_box_outside_of_the_picture_is_no_error(box: tuple[float, float, float, float]) -> None:
    face = Detection(box, np.zeros((2, 2), np.float32), 0.9)
    assert not judge_framing(person(MIDDLE), [face]).is_good
