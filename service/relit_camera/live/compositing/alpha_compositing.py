"""One picture over another, in linear light.

Both are already as the display shows them: blended before the display curve, a lamp behind the edge of the hair would
outshine all of it and leave a hard, shrunken outline.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ImageError
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_types import Alpha, DisplayImage, LinearImage, RgbaImage, check_image
from relit_camera.live.compositing.matted_frame import MattedFrame

NEIGHBORHOOD = 1 / 7
"""Width, as a share of the picture's height, of the window in which an edge's pure colours are sought, or a little more
or less: the picture is halved until that is about `_WINDOW`."""

_WINDOW = 7
"""Width of the window in pixels of the reduced picture."""

_EPSILON = np.float32(1e-4)

_TELLING_CONTRAST = np.float32(0.2)
"""How much more light the room must send than the person (linear, all channels together) for a pixel's colour to tell
as much about its alpha as the matte does. `python -m tests.rim_accuracy` measures it."""


def split_alpha(image: RgbaImage) -> tuple[DisplayImage, Alpha]:
    """The colors (height, width, 3) and the alpha (height, width) of a picture."""
    colors: DisplayImage = cv2.cvtColor(image, cv2.COLOR_RGBA2RGB)
    alpha: Alpha = cv2.extractChannel(image, 3)
    return colors, alpha


def over(
    foreground: DisplayImage, alpha: Alpha, background: DisplayImage, at: tuple[int, int] = (0, 0)
) -> DisplayImage:
    """Lay the foreground over the background; a new uint8 sRGB picture of the background's size.

    Where alpha is 0 or 255 pixels are copied; there is arithmetic for the others alone.

    Args:
        foreground: (h, w, 3), straight: its colors do not hold the factor alpha.
        alpha: (h, w), share of the foreground in linear light.
        background: (height, width, 3).
        at: column and row of the background where the foreground's corner comes; what falls outside is cut.

    Raises:
        ImageError: a picture is not uint8 (height, width, 3), or alpha has another type or size than the foreground.
    """
    check_image(background, np.uint8, "background")
    _check_alpha(foreground, alpha, "foreground")
    (left, top), (rows, columns) = at, alpha.shape
    height, width = background.shape[:2]
    if not (-rows < top < height and -columns < left < width):
        return background.copy()
    window = np.s_[max(-top, 0) : height - top, max(-left, 0) : width - left]
    foreground, alpha = np.ascontiguousarray(foreground[window]), np.ascontiguousarray(alpha[window])
    edge = _partial_pixels(alpha)
    out = np.array(background, order="C")
    share, light = _share_at(alpha, edge), _light_at(foreground, edge)
    return _blend(foreground, alpha, edge, share, light, out, (max(left, 0), max(top, 0)))


def replace_room(matted: MattedFrame, background: DisplayImage, in_place: bool = False) -> DisplayImage:
    """Lay the person in a live frame over another background, without the room that shines through the matte's edge.

    At the edge the camera saw C = αF + (1 - α)B. F and B are first guessed as the colors of surely person and surely
    room nearby; then F takes up what is left of C: F + α(C - αF - (1 - α)B), the closed-form step of Forte,
    "Approximate Fast Foreground Colour Estimation" (2021). Pixels with alpha 255 stay as they are. Before that, alpha
    is corrected where the colours tell it, see `_share_by_color`.

    Args:
        matted: the live frame, and the person's matte in it.
        background: uint8 sRGB (height, width, 3), of the frame's size.
        in_place: whether the background may be written to: it is then what is returned.

    Raises:
        ImageError: a picture is not uint8 (height, width, 3), or they differ in size.
    """
    image, alpha = matted.image, matted.matte
    check_image(background, np.uint8, "background")
    _check_alpha(image, alpha, "image")
    _check_alpha(background, alpha, "background")
    image, alpha = np.ascontiguousarray(image), np.ascontiguousarray(alpha)
    edge = _partial_pixels(alpha)
    person, room = _mean_layer_colors(matted, edge)
    left_over = _light_at(image, edge)
    share = _share_by_color(_share_at(alpha, edge), left_over, person, room)
    left_over -= room
    left_over -= share * (person - room)
    left_over *= share
    person += left_over
    out = background if in_place and background.flags.c_contiguous else np.array(background, order="C")
    return _blend(image, alpha, edge, share, person, out, (0, 0))


def _blend(
    foreground: DisplayImage,
    alpha: Alpha,
    edge: NDArray[np.intp],
    share: NDArray[np.float32],
    light: NDArray[np.float32],
    out: DisplayImage,
    at: tuple[int, int],
) -> DisplayImage:
    """Write the foreground into `out` where alpha is 255, and at its `edge` a mixture with the given light.

    Args:
        foreground: (rows, columns, 3), all of it within `out`.
        alpha: (rows, columns).
        edge: (count,) flat indices in alpha of what is neither clear nor opaque.
        share: (count,) alpha there, 0..1.
        light: (3, count) linear, straight, of the foreground there; it is written to.
        out: (height, width, 3), C-contiguous: the background, and in the end the mixture, which is returned.
        at: column and row of it where the foreground's corner comes.
    """
    (left, top), (rows, columns) = at, alpha.shape
    in_out = edge
    if columns != out.shape[1] or top or left:
        in_out = edge + (edge // columns) * (out.shape[1] - columns) + (top * out.shape[1] + left)
    behind = _light_at(out, in_out)
    # With alpha itself as the mask: its edge is written to below.
    cv2.copyTo(foreground, alpha, out[top : top + rows, left : left + columns])
    light -= behind
    light *= share
    light += behind
    codes, flat = uint8_from_linear(light), out.reshape(-1)
    first = 3 * in_out
    for channel in range(3):
        flat[channel:][first] = codes[channel]
    return out


def _mean_layer_colors(
    matted: MattedFrame, pixels: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Linear colors (3, count) of what is surely person, and of what is surely room, averaged around those pixels."""
    height, width = matted.matte.shape
    if _halvings(height) >= 2:
        matted = matted.quarter()
    for _ in range(_halvings(len(matted.matte))):
        matted = matted.half
    light = linear_from_uint8(matted.image)
    share = matted.matte * np.float32(1 / 255)
    # Enlarged as far as a step between two pixels is no longer seen.
    step = max(height // (4 * len(light)), 1)
    size = (-(-width // step), -(-height // step))
    rows = pixels // width
    at = rows // step * size[0] + (pixels - rows * width) // step
    person, room = (
        np.array(
            [cv2.resize(plane, size).reshape(-1).take(at) for plane in cv2.split(_weighted_mean(light, certainty))]
        )
        for certainty in (share, 1 - share)
    )
    return person, room


def _share_by_color(
    share: NDArray[np.float32], light: NDArray[np.float32], person: NDArray[np.float32], room: NDArray[np.float32]
) -> NDArray[np.float32]:
    """The alpha (count,) of edge pixels, corrected by where their colours lie between those of person and room.

    The matte knows no single hair, and its edge is some pixels wide. Only a room that is brighter than the person
    tells: what is bright there is room, while a dark pixel may be the person's own shaded rim as well as a dark room.
    Near 0 and 1 the matte is sure.

    Args:
        share: alpha of the matte, 0..1.
        light: (3, count) linear, of the pixels.
        person: (3, count) of what is surely person nearby, see `_mean_layer_colors`.
        room: the same of what is surely room.
    """
    beyond = np.maximum(room - person, 0)
    contrast = np.einsum("ci,ci->i", beyond, beyond)
    seen = np.einsum("ci,ci->i", room - light, beyond)
    seen /= np.maximum(contrast, 1e-6)
    np.clip(seen, 0, 1, out=seen)
    seen -= share
    seen *= contrast / (contrast + _TELLING_CONTRAST**2)
    seen *= 4 * share * (1 - share)
    return np.asarray(share + seen, np.float32)


def _halvings(rows: int) -> int:
    """How often a picture of so many rows is halved until `NEIGHBORHOOD` of it is about `_WINDOW` pixels."""
    count = 0
    while rows * NEIGHBORHOOD >= 1.5 * _WINDOW:
        rows, count = rows // 2, count + 1
    return count


def _weighted_mean(light: LinearImage, certainty: NDArray[np.float32]) -> LinearImage:
    """The mean of light around each pixel, by a certainty (height, width) in 0..1."""
    window = (_WINDOW, _WINDOW)
    for _ in range(4):  # so high a power, 16, that a pixel counts only when all but sure: at 0.9 by less than a fifth
        certainty = np.square(certainty)
    weight = certainty[..., np.newaxis]
    # The small constant leaves a pixel with nothing certain around it as it is.
    mean = cv2.blur(light * weight, window) + _EPSILON * light
    mean /= cv2.blur(weight, window)[..., np.newaxis] + _EPSILON
    return np.asarray(mean, np.float32)


def _partial_pixels(alpha: Alpha) -> NDArray[np.intp]:
    """Flat indices of the pixels that are neither clear nor opaque."""
    return np.flatnonzero(cv2.inRange(alpha, 1, 254).view(np.bool_))


def _light_at(image: DisplayImage, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
    """Linear light (3, count) of a C-contiguous image at flat indices.

    A channel at a time: numpy multiplies rows of three by a number each eight times as slowly as three long rows.
    """
    flat, first = image.reshape(-1), 3 * pixels
    return linear_from_uint8(np.array([flat[channel:].take(first) for channel in range(3)]))


def _share_at(alpha: Alpha, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
    """Alpha as 0..1, (count,), at flat indices."""
    return np.multiply(alpha.reshape(-1).take(pixels), np.float32(1 / 255), dtype=np.float32)


def _check_alpha(image: DisplayImage, alpha: Alpha, name: str) -> None:
    check_image(image, np.uint8, name)
    if alpha.dtype != np.uint8 or alpha.shape != image.shape[:2]:
        found = f"alpha is {alpha.dtype} {alpha.shape}, but the {name} {image.shape}"
        raise ImageError(found, "give both the same size, and alpha as uint8")
