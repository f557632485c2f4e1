"""Aligning pictures of one face under different light: each to what the others predict for its light.

Light adds up, so a picture is nearly a weighted sum of those under similar light (Belhumeur and Kriegman 1998). Which
weights, what is coarse tells: shading, hardly touched by a shift of a pixel. What is fine, features and texture, then
tells the shift. Directions of the light need not be known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.stabilise.dense import Template, smooth
from relit_camera.capture.stabilise.rigid import Rigid, move_picture, rigids_of, rows_of

Floats = NDArray[np.float64]
Pictures = NDArray[np.float32]

_LIKE = 16
"""Pictures from which one is predicted."""
_RIDGE = 0.02
_FINE_PX, _BROAD = 0.7, 0.15
"""The finest detail that counts; side of the squares whose mean is no detail, as a share of the picture's."""
_THUMBNAIL, _COARSE_PX = 48, 1.0
"""Side of pictures that show no more than shading, and how much they are smoothed."""
_SHADE = 0.02
"""Of the mean light: darkness in which differences no longer count for more."""
_LARGEST_SIDE = 256
_BORDER = 0.04


def align_pictures(
    pictures: Pictures,
    weights: NDArray[np.float32],
    start: Sequence[Rigid] | None = None,
    groups: NDArray[np.intp] | None = None,
    rounds: int = 6,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Rigid]:
    """Transforms, about the pictures' centre, that take each picture to where the face is on average.

    Args:
        pictures: (count, height, width) linear light, three at least.
        weights: (height, width) how much each pixel counts: 0 where the background is.
        start: transforms to begin with; none if not given.
        groups: (count,) pictures of one group do not predict each other: their errors are the same.
        rounds: how often all are predicted anew.
        progress: called with rounds done and their total.
    """
    count, height, width = pictures.shape
    scale = min(1.0, _LARGEST_SIDE / max(height, width))
    size = (round(width * scale), round(height * scale))
    small = np.stack([cv2.resize(picture, size, interpolation=cv2.INTER_AREA) for picture in pictures])
    inside = without_border(cv2.resize(weights, size, interpolation=cv2.INTER_AREA))
    transforms = [each.scaled(scale) for each in start] if start else [Rigid()] * count
    groups = np.arange(count) if groups is None else groups
    for done in range(rounds):
        transforms = _one_round(small, inside, transforms, groups)
        progress(done + 1, rounds)
    return [each.scaled(1 / scale) for each in transforms]


def _one_round(
    pictures: Pictures, weights: NDArray[np.float32], start: Sequence[Rigid], groups: NDArray[np.intp]
) -> list[Rigid]:
    moved = np.stack([move_picture(picture, each) for picture, each in zip(pictures, start, strict=True)])
    moved = np.maximum(moved, 0)
    coarse = _thumbnails(moved, weights)
    gram = coarse @ coarse.T
    aligned = []
    for index, picture in enumerate(pictures):
        like, shares = _prediction(gram, index, groups)
        predicted = np.tensordot(shares, moved[like], axes=1).astype(np.float32)
        shade = _SHADE * float(moved[index].mean()) + 1e-9
        template = Template(visible_detail(predicted, shade), weights, same_light=False)
        aligned.append(template.align(visible_detail(picture, shade), start[index]))
        moved[index] = np.maximum(move_picture(picture, aligned[index]), 0)
    # Only how they lie to each other is told: on average they stay where they were.
    rows = rows_of(aligned)
    return rigids_of(rows - rows.mean(axis=0) + rows_of(start).mean(axis=0))


def _prediction(gram: Floats, index: int, groups: NDArray[np.intp]) -> tuple[NDArray[np.intp], Floats]:
    """The pictures most like one, and their shares in it: ridge regression of what is coarse.

    Args:
        gram: (count, count) inner products of what is coarse in the pictures.
        index: of the one.
        groups: (count,) of all.
    """
    length = np.maximum(np.sqrt(gram.diagonal()), 1e-12)
    likeness = np.where(groups == groups[index], -np.inf, gram[index] / (length * length[index]))
    like = np.argsort(-likeness)[: min(_LIKE, int(np.isfinite(likeness).sum()))]
    among = gram[np.ix_(like, like)]
    ridge = _RIDGE * np.trace(among) / len(like) * np.eye(len(like))
    return like, np.linalg.solve(among + ridge, gram[like, index])


def _thumbnails(pictures: Pictures, weights: NDArray[np.float32]) -> Floats:
    """The pictures' shading (count, values), without features."""
    size = (min(weights.shape[1], _THUMBNAIL), min(weights.shape[0], _THUMBNAIL))

    def small(picture: NDArray[np.float32]) -> NDArray[np.float32]:
        return smooth(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), _COARSE_PX)

    # Light from outside the weights must not leak in, nor be missed at their edge.
    share = small(weights)
    inside = np.sqrt(share) / np.maximum(share, 1e-3)
    return (
        np.stack([small(picture * weights) * inside for picture in pictures]).reshape(len(pictures), -1).astype(float)
    )


def visible_detail(light: NDArray[np.float32], shade: float) -> NDArray[np.float32]:
    """Detail of linear light (height, width) as the eye weighs it: of the root, neither too fine nor too broad."""
    root = np.sqrt(np.maximum(light, 0) + np.float32(shade))
    mean = cv2.blur(root, 2 * [round(_BROAD * max(light.shape))])
    return np.asarray(smooth(root, _FINE_PX) - mean, np.float32)


def without_border(weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Weights (height, width), 0 along the border, over which pictures move."""
    border = max(2, round(_BORDER * max(weights.shape)))
    inner = np.zeros_like(weights)
    inner[border:-border, border:-border] = weights[border:-border, border:-border]
    return inner
