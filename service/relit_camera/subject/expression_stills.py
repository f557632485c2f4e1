"""Expression stills: pictures of the person in an expression or a turn, which the source image does not show.

A still is an ordinary frame in the light of a room, cropped to the face, with what the face does in it and the light
that it was taken in. Mode portrait takes the inside of the mouth, shut lids and turned cheeks from them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import SubjectError
from relit_camera.base.images.decoder_messages import suppress_decoder_messages
from relit_camera.base.images.image_limits import image_header
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH
from relit_camera.light.light_map import LightMap

STILL_SCHEME, STILL_POINTS = "mesh478", 478
"""The landmark scheme of all stills, and its number of points."""
MAX_STILLS = 20
MAX_STILL_SIDE_PX = 640
"""Largest side of a still's picture: twenty of them, on top of each other, stay within a WebP picture's limits."""
WEBP_QUALITY = 92
OUTSIDE = 0.25
"""Share of the larger side of a still's picture by which a landmark may lie outside it."""
EYE_CORNERS, MIN_EYE_SPAN_PX = (33, 263), 2.0
"""The outer corners of the eyes in `STILL_SCHEME`, and their least distance."""
MAX_EXPRESSION_CM, MAX_ROTATION_RAD = 20.0, 2 * np.pi
"""Largest movement of a point, and largest turn: no face does more."""
PREFIX = "stills."
STILL_TENSORS = tuple(PREFIX + name for name in ("webp", "landmarks", "expressions", "rotations", "lights"))
"""Tensors of a subject file that hold the stills: all of them, or none."""


@dataclass(frozen=True)
class ExpressionStill:
    """One picture of the person, and what the face does in it.

    Attributes:
        image: (height, width, 3) uint8 sRGB, cropped to the face.
        landmarks: (478, 2) float32 pixels of `image`, of `STILL_SCHEME`.
        expression: (478, 3) float32 centimetres: head-space points minus those of the neutral face.
        rotation: (3,) float32 rotation vector of the head since the neutral pose, radians.
        light: (32, 64, 3) float32 radiance of the room, as the head in the still sees it.
    """

    image: DisplayImage
    landmarks: Points
    expression: NDArray[np.float32]
    rotation: NDArray[np.float32]
    light: LightMap

    def __post_init__(self) -> None:
        """Check that the arrays fit together.

        Raises:
            ValueError: one does not; the message has its shape.
        """
        points = STILL_POINTS
        shapes: dict[str, tuple[NDArray, tuple[int, ...]]] = {
            "image": (self.image, (*self.image.shape[:2], 3)),
            "landmarks": (self.landmarks, (points, 2)),
            "expression": (self.expression, (points, 3)),
            "rotation": (self.rotation, (3,)),
            "light": (self.light, (MAP_HEIGHT, MAP_WIDTH, 3)),
        }
        for name, (array, shape) in shapes.items():
            if array.shape != shape:
                raise ValueError(f"a still's {name} has shape {array.shape}, not {shape}")


TYPES: dict[str, tuple[type[np.generic], ...]] = {PREFIX + "webp": (np.uint8,), PREFIX + "lights": (np.float16,)}
"""Types of the tensors that are not float32."""


def still_tensors(stills: Sequence[ExpressionStill]) -> dict[str, NDArray]:
    """The tensors that hold some stills of one picture size; none for no stills.

    Raises:
        ValueError: their pictures differ in size, or there are too many, or they are too large.
    """
    if not stills:
        return {}
    shape = stills[0].image.shape
    if any(still.image.shape != shape for still in stills):
        raise ValueError("the stills' pictures differ in size")
    if len(stills) > MAX_STILLS or max(shape) > MAX_STILL_SIDE_PX:
        raise ValueError(f"{len(stills)} stills of {shape[1]}x{shape[0]} are more than a subject may have")
    column = cv2.cvtColor(np.concatenate([still.image for still in stills]), cv2.COLOR_RGB2BGR)
    _, encoded = cv2.imencode(".webp", column, [cv2.IMWRITE_WEBP_QUALITY, WEBP_QUALITY])
    return {
        PREFIX + "webp": np.asarray(encoded, np.uint8).ravel(),
        PREFIX + "landmarks": np.stack([still.landmarks for still in stills]).astype(np.float32),
        PREFIX + "expressions": np.stack([still.expression for still in stills]).astype(np.float32),
        PREFIX + "rotations": np.stack([still.rotation for still in stills]).astype(np.float32),
        PREFIX + "lights": np.stack([still.light for still in stills]).astype(np.float16),
    }


def stills_of_tensors(tensors: Mapping[str, NDArray]) -> tuple[ExpressionStill, ...]:
    """The inverse of `still_tensors`, but for what WebP loses; other tensors are left alone.

    Raises:
        SubjectError: a tensor of the stills is missing, or the picture cannot be decoded.
        ValueError: their shapes do not fit together, or no face has such values.
    """
    if not any(name in tensors for name in STILL_TENSORS):
        return ()
    for name in STILL_TENSORS:
        if name not in tensors:
            raise SubjectError(f"it has stills without '{name}'", "restore the file from a copy")
    encoded, *rest = (tensors[name] for name in STILL_TENSORS)
    count = len(rest[0])
    if not 1 <= count <= MAX_STILLS or any(len(each) != count for each in rest):
        raise ValueError(f"the stills' tensors hold {[len(each) for each in rest]} stills")
    size = _size(encoded, count)
    _require_plausible(size, *rest)
    pictures = np.split(_decoded(encoded, (size[0], count * size[1])), count)
    return tuple(
        ExpressionStill(np.ascontiguousarray(picture), landmarks, expression, rotation, light.astype(np.float32))
        for picture, landmarks, expression, rotation, light in zip(pictures, *rest, strict=True)
    )


def _broken() -> SubjectError:
    return SubjectError("its expression stills cannot be decoded", "restore the file from a copy")


def _size(encoded: NDArray[np.uint8], count: int) -> tuple[int, int]:
    """Width and height of each of `count` stills that lie on top of each other in one WebP picture."""
    data = encoded.tobytes() if encoded.ndim == 1 else b""
    if not data.startswith(b"RIFF") or data[8:12] != b"WEBP":  # OpenCV would decode any other kind of picture too
        raise _broken()
    try:
        width, height = image_header(data).size
    except ValueError as error:
        raise _broken() from error
    if width > MAX_STILL_SIDE_PX or height > count * MAX_STILL_SIDE_PX or height % count:
        raise _broken()
    return width, height // count


def _require_plausible(
    size: tuple[int, int],
    landmarks: NDArray[np.float32],
    expressions: NDArray[np.float32],
    rotations: NDArray[np.float32],
    lights: NDArray[np.float16],
) -> None:
    """Raise ValueError where the stills' arrays hold values that would cost minutes or crash."""
    margin = OUTSIDE * max(size)
    if landmarks.shape[1:] == (STILL_POINTS, 2):
        if (landmarks < -margin).any() or (landmarks > np.array(size) + margin).any():
            raise ValueError("landmarks of a still lie far outside its picture")
        right, left = (landmarks[:, corner].astype(np.float64) for corner in EYE_CORNERS)
        if (np.linalg.norm(left - right, axis=1) < MIN_EYE_SPAN_PX).any():
            raise ValueError(f"the eyes in a still are less than {MIN_EYE_SPAN_PX:.0f} pixels apart")
    for values, limit, name in (
        (expressions, MAX_EXPRESSION_CM, "expression"),
        (rotations, MAX_ROTATION_RAD, "rotation"),
    ):
        if (np.linalg.norm(values.astype(np.float64), axis=-1) > limit).any():
            raise ValueError(f"a still's {name} is larger than {limit:.1f}")
    if (lights < 0).any():
        raise ValueError("a still's light is negative")


def _decoded(encoded: NDArray[np.uint8], size: tuple[int, int]) -> DisplayImage:
    """The picture, which states this width and height."""
    with suppress_decoder_messages():
        column = cv2.imdecode(np.array(encoded), cv2.IMREAD_COLOR)
    if column is None or column.shape != (size[1], size[0], 3):
        raise _broken()
    return np.asarray(cv2.cvtColor(column, cv2.COLOR_BGR2RGB), np.uint8)
