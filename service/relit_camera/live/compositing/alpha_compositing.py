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

_NEIGHBORHOOD = 1 / 7
"""Width, as a share of the picture's height, of the window in which an edge's pure colours are sought."""

_WINDOW = 13
"""The same in pixels of the reduced picture on which it is done."""

_EPSILON = np.float32(1e-4)


def split_alpha(image: RgbaImage) -> tuple[DisplayImage, Alpha]:
    """The colors (height, width, 3) and the alpha (height, width) of a picture."""
    colors: DisplayImage = cv2.cvtColor(image, cv2.COLOR_RGBA2RGB)
    alpha: Alpha = cv2.extractChannel(image, 3)
    return colors, alpha


def over(foreground: DisplayImage, alpha: Alpha, background: DisplayImage, at: tuple[int, int] = (0, 0)) -> DisplayImage:
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
    out = np.array(background, order="C")
    (left, top), (rows, columns) = at, alpha.shape
    below = out[max(top, 0) : max(top + rows, 0), max(left, 0) : max(left + columns, 0)]
    if below.size:
        window = np.s_[max(-top, 0) :, max(-left, 0) :]
        seen = np.s_[: below.shape[0], : below.shape[1]]
        foreground, alpha = foreground[window][seen], alpha[window][seen]
        edge = _partial_pixels(alpha)
        row, column = np.divmod(edge, alpha.shape[1])
        in_out = (row + max(top, 0)) * out.shape[1] + column + max(left, 0)
        light, behind = (_light_at(image, at) for image, at in ((np.ascontiguousarray(foreground), edge), (out, in_out)))
        cv2.copyTo(foreground, cv2.compare(alpha, 255, cv2.CMP_EQ), below)
        _set(out, in_out, behind + _share_at(alpha, edge) * (light - behind))
    return out


def unpremultiply(premultiplied: LinearImage, alpha: NDArray[np.float32]) -> LinearImage:
    """Colors (height, width, 3) without the factor alpha (height, width), as `over` wants them once they are coded.

    Where alpha is 0 there is no color to find: it stays as it is.
    """
    share = np.where(alpha > 0, alpha, np.float32(1))[..., np.newaxis]
    return np.asarray(premultiplied / share, dtype=np.float32)


def estimate_foreground_colors(image: DisplayImage, alpha: Alpha) -> DisplayImage:
    """The person's own colors, without the room that shines through the matte's edge, as `over` wants them.

    At the edge the camera saw C = αF + (1 - α)B. F and B are first guessed as the colors of surely person and surely
    room nearby; then F takes up what is left of C: F + α(C - αF - (1 - α)B), the closed-form step of Forte,
    "Approximate Fast Foreground Colour Estimation" (2021). Pixels with alpha 255 stay as they are.

    Args:
        image: uint8 sRGB (height, width, 3), the live frame.
        alpha: (height, width), the person's matte in it.

    Raises:
        ImageError: the image is not uint8 (height, width, 3), or alpha has another type or size.
    """
    _check_alpha(image, alpha, "image")
    edge = _partial_pixels(alpha)
    if edge.size == 0:
        return image
    person, room = (_light_at(guess, edge) for guess in _mean_layer_colors(image, alpha))
    share = _share_at(alpha, edge)
    result = image.copy()
    _set(result, edge, person + share * (_light_at(image, edge) - room - share * (person - room)))
    return result


def _mean_layer_colors(image: DisplayImage, alpha: Alpha) -> tuple[DisplayImage, DisplayImage]:
    """Colors of what is surely person, and of what is surely room, averaged around each pixel; the image's size."""
    height, width = alpha.shape
    reduce = max(1, round(height * _NEIGHBORHOOD / _WINDOW))
    size = (max(1, width // reduce), max(1, height // reduce))
    light = linear_from_uint8(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
    share = cv2.resize(alpha, size, interpolation=cv2.INTER_AREA).astype(np.float32) / np.float32(255)
    # So high a power that a pixel counts only when it is all but sure: at 0.9 already by less than a fifth.
    person, room = (_weighted_mean(light, certainty**16) for certainty in (share, 1 - share))
    return cv2.resize(person, (width, height)), cv2.resize(room, (width, height))


def _weighted_mean(light: LinearImage, weight: NDArray[np.float32]) -> DisplayImage:
    window = (_WINDOW, _WINDOW)
    weight = weight[..., np.newaxis]
    # The small constant leaves a pixel with nothing certain around it as it is.
    mean = (cv2.blur(light * weight, window) + _EPSILON * light) / (
        cv2.blur(weight, window)[..., np.newaxis] + _EPSILON
    )
    return uint8_from_linear(mean)


def _partial_pixels(alpha: Alpha) -> NDArray[np.intp]:
    """Flat indices of the pixels that are neither clear nor opaque."""
    return np.flatnonzero(cv2.inRange(alpha, 1, 254).view(np.bool_))


def _light_at(image: DisplayImage, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
    """Linear light (count, 3) of an image at flat indices. `take` is several times as fast as indexing."""
    return linear_from_uint8(image.reshape(-1, 3).take(pixels, axis=0))


def _share_at(alpha: Alpha, pixels: NDArray[np.intp]) -> NDArray[np.float32]:
    """Alpha as 0..1, (count, 1), at flat indices."""
    return np.multiply(alpha.reshape(-1, 1).take(pixels, axis=0), np.float32(1 / 255), dtype=np.float32)


def _set(image: DisplayImage, pixels: NDArray[np.intp], light: NDArray[np.float32]) -> None:
    """Write linear light (count, 3) into a contiguous image at flat indices."""
    codes, flat = uint8_from_linear(light), image.reshape(-1, 3)
    for channel in range(3):  # thrice as fast as whole pixels
        flat[pixels, channel] = codes[:, channel]


def _check_alpha(image: DisplayImage, alpha: Alpha, name: str) -> None:
    check_image(image, np.uint8, name)
    if alpha.dtype != np.uint8 or alpha.shape != image.shape[:2]:
        found = f"alpha is {alpha.dtype} {alpha.shape}, but the {name} {image.shape}"
        raise ImageError(found, "give both the same size, and alpha as uint8")
