"""Expression stills: pictures of the person in an expression or a turn, which the source image does not show.

A still is an ordinary frame in the light of a room, cropped to the face, with what the face does in it and the light
that it was taken in. Mode reenact takes the inside of the mouth, shut lids and the far cheek from them.
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
        ValueError: their shapes do not fit together.
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
    pictures = np.split(_decoded(encoded, count), count)
    return tuple(
        ExpressionStill(np.ascontiguousarray(picture), landmarks, expression, rotation, light.astype(np.float32))
        for picture, landmarks, expression, rotation, light in zip(pictures, *rest, strict=True)
    )


def _decoded(encoded: NDArray[np.uint8], count: int) -> DisplayImage:
    """The pictures of `count` stills, on top of each other."""
    broken = SubjectError("its expression stills cannot be decoded", "restore the file from a copy")
    try:
        width, height = image_header(encoded.tobytes()).size
    except ValueError as error:
        raise broken from error
    if width > MAX_STILL_SIDE_PX or height > count * MAX_STILL_SIDE_PX or height % count:
        raise broken
    with suppress_decoder_messages():
        column = cv2.imdecode(np.array(encoded), cv2.IMREAD_COLOR)
    if column is None or column.shape != (height, width, 3):
        raise broken
    return np.asarray(cv2.cvtColor(column, cv2.COLOR_BGR2RGB), np.uint8)
