"""Judges how well a person sits before the webcam, from one frame and the faces that a detector found in it.

The limits lie between recordings of people that are framed well and the same ones darkened, blurred and cropped
(docs/instant.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.face.detection.face_detector import Box, Detection, reduced
from relit_camera.face.framing.framing import FaceCount, Framing, FramingItem, FramingState

_SMALL_PX = 160
"""Longer side of the picture in which light and exposure are measured."""
_FACE_PX = 128
"""Width of the face in which sharpness is measured: faces near and far are judged alike."""
_BYSTANDER = 0.35
"""A second face counts if its height is at least so much of the largest one's."""


@dataclass(frozen=True)
class FramingLimits:
    """From where on something is no longer good.

    Attributes:
        far, near: height of the face (brows to chin), in parts of the frame's height.
        head_room: room above the face for the rest of the head, in heights of the face.
        off_center: distance of the face's middle from the frame's, in parts of the frame's width.
        one_sided: linear light on one half of the face over that on the other.
        backlit: linear light of what is beside the face over that of the face.
        blurred: variance of the face's Laplacian over the variance of its grey values.
        dark: 90th percentile of the face's grey values, 0..255.
        burnt: fraction of the face's pixels that are white in some channel.
    """

    far: float = 0.16
    near: float = 0.68
    head_room: float = 0.2
    off_center: float = 0.22
    one_sided: float = 2.5
    backlit: float = 5.0
    blurred: float = 0.008
    dark: float = 75.0
    burnt: float = 0.1


DEFAULT_LIMITS = FramingLimits()
_ROUNDING = 20 / 12
"""Variance of the Laplacian that comes from the rounding of grey values alone: the squares of its weights make 20."""

_GOOD = FramingItem(FramingState.GOOD)
_UNKNOWN = FramingItem(FramingState.UNKNOWN)
_NO_FACE = "No face is in the picture: sit before the webcam and look at it."
_SEVERAL = "There are several faces in the picture: be alone in it."


def judge_framing(image: DisplayImage, faces: Sequence[Detection], limits: FramingLimits = DEFAULT_LIMITS) -> Framing:
    """Judge one frame.

    Args:
        image: uint8 sRGB RGB (height, width, 3).
        faces: all that were found in it.
        limits: from where on something is no longer good.
    """
    if not faces:
        return Framing(FaceCount.NONE, _NO_FACE, _UNKNOWN, _UNKNOWN, _UNKNOWN, _UNKNOWN, _UNKNOWN)
    faces = sorted(faces, key=lambda face: face.box[3], reverse=True)
    count = sum(face.box[3] >= _BYSTANDER * faces[0].box[3] for face in faces)
    box, (height, width) = faces[0].box, image.shape[:2]
    distance, position = _distance(box, height, limits), _position(box, width, height, limits)
    light, exposure = _light_and_exposure(image, box, limits)
    sharpness = _sharpness(image, box, limits)
    # In the order in which they are best mended: what is too dark cannot be judged for the rest.
    items = (distance, position, exposure, light, sharpness)
    advice = _SEVERAL if count > 1 else next((item.advice for item in items if item.advice), "")
    return Framing(
        FaceCount.SEVERAL if count > 1 else FaceCount.ONE,
        advice,
        distance,
        position,
        light,
        sharpness,
        exposure,
        (box[0] / width, box[1] / height, box[2] / width, box[3] / height),
    )


def _distance(box: Box, height: int, limits: FramingLimits) -> FramingItem:
    part = box[3] / height
    if part < limits.far:
        return FramingItem(FramingState.FAR, "Come closer: your face is small in the picture.")
    if part > limits.near:
        return FramingItem(FramingState.NEAR, "Move back a little: your face fills the picture.")
    return _GOOD


def _position(box: Box, width: int, height: int, limits: FramingLimits) -> FramingItem:
    left, top, face_width, face_height = box
    aside = abs(left + face_width / 2 - width / 2) > limits.off_center * width
    cut = left < 0 or left + face_width > width or top < limits.head_room * face_height or top + face_height > height
    if aside or cut:
        advice = "Move so that your whole head is in the middle of the picture."
        return FramingItem(FramingState.OFF_CENTER, advice)
    return _GOOD


def _light_and_exposure(image: DisplayImage, box: Box, limits: FramingLimits) -> tuple[FramingItem, FramingItem]:
    small = reduced(image, _SMALL_PX)
    scale = small.shape[1] / image.shape[1]
    face = _inside(small, box, scale)
    grey = cv2.cvtColor(face, cv2.COLOR_RGB2GRAY)
    linear = _luminance(face)
    middle = linear.shape[1] // 2
    left, right = float(linear[:, :middle].mean()), float(linear[:, -middle:].mean())
    exposure = _GOOD
    if float(np.percentile(grey, 90)) < limits.dark:
        exposure = FramingItem(FramingState.DARK, "It is too dark: put a light before you, or open the curtain.")
    elif float((face.max(axis=2) >= 254).mean()) > limits.burnt:
        exposure = FramingItem(
            FramingState.BRIGHT, "Parts of your face are white: turn down the light that falls on it."
        )
    light = _GOOD
    if max(left, right) > limits.one_sided * max(min(left, right), 1e-4):
        light = FramingItem(FramingState.ONE_SIDED, "The light comes from one side: turn towards it.")
    elif _beside(small, box, scale) > limits.backlit * max(float(linear.mean()), 1e-4):
        light = FramingItem(FramingState.BACKLIT, "The light is behind you: turn towards it, or draw the curtain.")
    return light, exposure


def _sharpness(image: DisplayImage, box: Box, limits: FramingLimits) -> FramingItem:
    face = cv2.cvtColor(_inside(image, box, 1.0), cv2.COLOR_RGB2GRAY)
    if face.shape[1] > _FACE_PX:
        size = (_FACE_PX, max(1, round(face.shape[0] * _FACE_PX / face.shape[1])))
        face = np.asarray(cv2.resize(face, size, interpolation=cv2.INTER_AREA), np.uint8)
    if sharpness(face) < limits.blurred:
        return FramingItem(FramingState.BLURRED, "The picture is blurred: hold still, wipe the lens, or add light.")
    return _GOOD


def sharpness(grey: NDArray[np.uint8]) -> float:
    """Variance of the Laplacian over the variance of the grey values: high for fine detail, whatever the contrast."""
    variance = float(grey.var())
    detail = float(cv2.Laplacian(grey, cv2.CV_32F).var()) - _ROUNDING
    return max(detail, 0.0) / variance if variance > 0 else 0.0


def _inside(image: DisplayImage, box: Box, scale: float) -> DisplayImage:
    """The middle of the face, without hair and room: at least two pixels a side."""
    left, top, width, height = (side * scale for side in box)
    rows, columns = image.shape[:2]
    first_column = min(max(round(left + 0.1 * width), 0), columns - 2)
    last_column = max(min(round(left + 0.9 * width), columns), first_column + 2)
    first_row = min(max(round(top + 0.1 * height), 0), rows - 2)
    last_row = max(min(round(top + 0.9 * height), rows), first_row + 2)
    return image[first_row:last_row, first_column:last_column]


def _beside(small: DisplayImage, box: Box, scale: float) -> float:
    """Linear light of what is left, right and above of the head, down to the chin; 0 where the head fills it all."""
    left, top, width, height = (side * scale for side in box)
    beside = np.ones(small.shape[:2], bool)
    beside[max(round(top + height), 0) :] = False
    beside[:, max(round(left - 0.5 * width), 0) : max(round(left + 1.5 * width), 0)] = False
    return float(_luminance(small)[beside].mean()) if beside.any() else 0.0


def _luminance(image: DisplayImage) -> NDArray[np.float32]:
    linear: NDArray[np.float32] = linear_from_uint8(image) @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    return linear
