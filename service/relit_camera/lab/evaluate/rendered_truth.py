"""The `truth.json` of a rendered capture video: what is known of its balls, light, flash and head motion.

`python -m relit_studio capture` writes it. Lengths in pixels are of the video. Directions are unit vectors in camera
axes: X right, Y up, Z toward the camera.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import Field

from relit_camera.lab.evaluate.json_records import Record, read_json_record

Vector3 = tuple[float, float, float]


class HeadMovement(Record):
    """Rigid motion that takes the head's picture back to its rest position.

    Attributes:
        rotation_deg: counter-clockwise about the picture's center.
        translation_px: right and down.
    """

    rotation_deg: float
    translation_px: tuple[float, float]


class Head(Record):
    """The head in one frame.

    Attributes:
        to_rest: its motion, undone.
    """

    to_rest: HeadMovement


class HeadFrame(Record):
    """A frame of which the head's motion is known.

    Attributes:
        head: the head.
    """

    head: Head


class HeadTruth(Record):
    """The part of `truth.json` that tells the head's motion.

    Attributes:
        frames: of the video, in order.
    """

    frames: Annotated[list[HeadFrame], Field(min_length=1)]


class Ball(Record):
    """A mirror ball in the picture.

    Attributes:
        x_px, y_px: its center.
        radius_px: its radius.
    """

    x_px: float
    y_px: float
    radius_px: float


class Light(Record):
    """The hand-held light in one frame.

    Attributes:
        direction: from the head toward the light.
        at_ball: from the ball toward the light.
        at_second_ball: the same for the second ball; None where there is none.
        distance_cm: from the head to the light.
    """

    direction: Vector3
    at_ball: Vector3
    at_second_ball: Vector3 | None = None
    distance_cm: Annotated[float, Field(gt=0)]


class Flash(Record):
    """The flash in one frame.

    Attributes:
        state: whether it lit all rows of the frame, none, or some.
    """

    state: Literal["bright", "dark", "partial"]


class CaptureFrame(HeadFrame):
    """A frame of which everything is known.

    Attributes:
        index: its number in the video.
        light: the hand-held light.
        flash: the flash.
    """

    index: int
    light: Light
    flash: Flash


class CaptureTruth(Record):
    """The whole `truth.json`, as far as captures are compared with it.

    Attributes:
        ball: the mirror ball.
        second_ball: the second one; None where there is none.
        focal_px: focal length of the camera.
        frames: of the video, in order.
    """

    ball: Ball
    second_ball: Ball | None = None
    focal_px: float
    frames: Annotated[list[CaptureFrame], Field(min_length=1)]


Truth = TypeVar("Truth", HeadTruth, CaptureTruth)


def read_truth(path: Path, form: type[Truth]) -> Truth:
    """Read a `truth.json` as `HeadTruth` or `CaptureTruth`.

    Raises:
        InputError: missing, no JSON, or in another form.
    """
    return read_json_record(path, form, "give the truth.json of a rendered capture")
