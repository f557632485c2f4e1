"""Where the subject's picture sits in the output."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Box = tuple[int, int, int, int]


def still_from_output(still: tuple[int, int], output: tuple[int, int]) -> NDArray[np.float64]:
    """The affine map (2, 3) from output pixels to still pixels: the still fitted in whole, centred, on the bottom edge.

    Args:
        still: (width, height).
        output: (width, height).
    """
    scale = min(output[0] / still[0], output[1] / still[1])
    left = (output[0] - scale * still[0]) / 2
    top = output[1] - scale * still[1]
    return np.array([[1 / scale, 0, -left / scale], [0, 1 / scale, -top / scale]])


def moved_body(
    placed: NDArray[np.float64], pivot: NDArray[np.float64], shift: NDArray[np.float64], scale: float, bottom: float
) -> NDArray[np.float64]:
    """`placed`, with the person moved by `shift` and grown by `scale` about `pivot`, all in still pixels.

    The still's lower edge, at y = `bottom`, never rises into view: nobody hovers.
    """
    lift = shift[1] + (scale - 1) * (bottom - pivot[1])
    shift = shift - [0.0, min(lift, 0.0)]
    view = np.array([[1 / scale, 0, 0], [0, 1 / scale, 0]])
    view[:, 2] = pivot - (pivot + shift) / scale
    return np.asarray(view @ np.vstack([placed, [0, 0, 1]]))


def visible_box(placed: NDArray[np.float64], still: tuple[int, int], output: tuple[int, int]) -> Box:
    """The output pixels (left, top, right, bottom) in which the still is seen under an affine map without rotation."""
    inverse = inverse_affine(placed)
    corners = np.array([[0, 0], still]) @ inverse[:, :2].T + inverse[:, 2]
    left, top = np.clip(np.floor(corners.min(axis=0)), 0, output).astype(int)
    right, bottom = np.clip(np.ceil(corners.max(axis=0)), 0, output).astype(int)
    return int(left), int(top), int(right), int(bottom)


def inverse_affine(affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inverse (2, 3) of an affine map (2, 3)."""
    return np.linalg.inv(np.vstack([affine, [0, 0, 1]]))[:2]
