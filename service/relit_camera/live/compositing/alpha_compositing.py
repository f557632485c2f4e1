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
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask, check_image

_CLEAR, _OPAQUE = 1 / 8192, 1 - 1 / 8192
"""Alpha beyond these counts as 0 and 1: even white over black changes by less than half a code."""

_NEIGHBORHOOD = 1 / 7
"""Width, as a share of the picture's height, of the window in which an edge's pure colours are sought."""

_WINDOW = 13
"""The same in pixels of the reduced picture on which it is done."""

_EPSILON = np.float32(1e-4)


def unpremultiply(premultiplied: LinearImage, alpha: Mask) -> LinearImage:
    """Colours without the factor alpha that warping wants, both of one height and width; `over` wants them so.

    Where alpha is 0 there is no colour to find: it stays as it is.
    """
    edge = _partial_pixels(alpha)
    colors = premultiplied.copy()
    colors.reshape(-1, 3)[edge] = _at(premultiplied, edge) / _at(alpha[..., np.newaxis], edge)
    return colors


def over(foreground: DisplayImage, alpha: Mask, background: DisplayImage, at: tuple[int, int] = (0, 0)) -> DisplayImage:
    """Lay the foreground over the background; a new uint8 sRGB picture of the background's size.

    Args:
        foreground: (h, w, 3), straight: its colours do not hold the factor alpha.
        alpha: (h, w), share of the foreground in linear light.
        background: (height, width, 3).
        at: column and row of the background where the foreground's corner comes; what falls outside is cut.

    Raises:
        ImageError: a picture is not uint8 (height, width, 3), or alpha has another size than the foreground.
    """
    check_image(background, np.uint8, "background")
    _check_alpha(foreground, alpha, "foreground")
    out = background.copy()
    (left, top), (rows, columns) = at, alpha.shape
    below = out[max(top, 0) : max(top + rows, 0), max(left, 0) : max(left + columns, 0)]
    if below.size:
        window = np.s_[max(-top, 0) :, max(-left, 0) :]
        seen = np.s_[: below.shape[0], : below.shape[1]]
        below[:] = _blend(foreground[window][seen], alpha[window][seen], below)
    return out


def estimate_foreground_colors(image: DisplayImage, alpha: Mask) -> DisplayImage:
    """The person's own colours, without the room that shines through the matte's edge, as `over` wants them.

    At the edge the camera saw C = αF + (1 - α)B. F and B are first guessed as the colours of surely person and surely
    room nearby; then F takes up what is left of C: F + α(C - αF - (1 - α)B), the closed-form step of Forte,
    "Approximate Fast Foreground Colour Estimation" (2021). Pixels with alpha 1 stay as they are.

    Args:
        image: uint8 sRGB (height, width, 3), the live frame.
        alpha: (height, width), the person's matte in it.

    Raises:
        ImageError: the image is not uint8 (height, width, 3), or alpha has another size.
    """
    _check_alpha(image, alpha, "image")
    edge = _partial_pixels(alpha)
    if edge.size == 0:
        return image
    person, room = (_light_at(guess, edge) for guess in _mean_layer_colors(image, alpha))
    share = _at(alpha[..., np.newaxis], edge)
    result = image.copy()
    _set(result, edge, person + share * (_light_at(image, edge) - room - share * (person - room)))
    return result


def _blend(foreground: DisplayImage, alpha: Mask, background: DisplayImage) -> DisplayImage:
    """Blend pictures of one size: a copy where alpha is 1, arithmetic only where it is neither 0 nor 1."""
    out = np.array(background, order="C")
    cv2.copyTo(foreground, cv2.compare(alpha, _OPAQUE, cv2.CMP_GT), out)
    edge = _partial_pixels(alpha)
    light, below = _light_at(foreground, edge), _light_at(background, edge)
    _set(out, edge, below + _at(alpha[..., np.newaxis], edge) * (light - below))
    return out


def _mean_layer_colors(image: DisplayImage, alpha: Mask) -> tuple[DisplayImage, DisplayImage]:
    """Colours of what is surely person, and of what is surely room, averaged around each pixel; the image's size."""
    height, width = alpha.shape
    reduce = max(1, round(height * _NEIGHBORHOOD / _WINDOW))
    size = (max(1, width // reduce), max(1, height // reduce))
    light = linear_from_uint8(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    share = cv2.resize(alpha, size, interpolation=cv2.INTER_AREA)
    # So high a power that a pixel counts only when it is all but sure: at 0.9 already by less than a fifth.
    person, room = (_weighted_mean(light, certainty**16) for certainty in (share, 1 - share))
    return cv2.resize(person, (width, height)), cv2.resize(room, (width, height))


def _weighted_mean(light: LinearImage, weight: Mask) -> DisplayImage:
    window = (_WINDOW, _WINDOW)
    weight = weight[..., np.newaxis]
    # The small constant leaves a pixel with nothing certain around it as it is.
    mean = (cv2.blur(light * weight, window) + _EPSILON * light) / (
        cv2.blur(weight, window)[..., np.newaxis] + _EPSILON
    )
    return uint8_from_linear(mean)


def _partial_pixels(alpha: Mask) -> NDArray[np.intp]:
    """Flat indices of the pixels that are neither clear nor opaque."""
    return np.flatnonzero(cv2.inRange(alpha, _CLEAR, _OPAQUE).view(np.bool_))


def _at(image: NDArray, pixels: NDArray[np.intp]) -> NDArray:
    """The values (count, channels) of an image at flat indices. `take` is several times as fast as indexing."""
    return image.reshape(-1, image.shape[2]).take(pixels, axis=0)


def _light_at(image: DisplayImage, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
    return linear_from_uint8(_at(image, pixels))


def _set(image: DisplayImage, pixels: NDArray[np.intp], light: NDArray[np.float32]) -> None:
    image.reshape(-1, 3)[pixels] = uint8_from_linear(light)


def _check_alpha(image: DisplayImage, alpha: Mask, name: str) -> None:
    check_image(image, np.uint8, name)
    if alpha.shape != image.shape[:2]:
        raise ImageError(f"alpha has shape {alpha.shape}, but the {name} {image.shape}", "give both the same size")
