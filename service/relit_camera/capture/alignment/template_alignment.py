"""Aligning a picture to another of the same light by all of its pixels.

Gauss and Newton's way, the template's gradient taken once (inverse compositional; Baker and Matthews 2004), pixels that
do not fit counting less.

Aligning pictures of one face under different light: each to what the others predict for its light.

Light adds up, so a picture is nearly a weighted sum of those under similar light (Belhumeur and Kriegman 1998). Which
weights, what is coarse tells: shading, hardly touched by a shift of a pixel. What is fine, features and texture, then
tells the shift. Directions of the light need not be known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.resize import shrink
from relit_camera.capture.alignment.rigid_transform import (
    RigidTransform,
    transforms_from_array,
    transforms_to_array,
    warp_affine,
    warp_to_reference,
)

Picture = NDArray[np.float32]

_ITERATIONS = 12
_ENOUGH_PX = 0.01
_SAMPLED = 7
"""Every so many-th pixel tells the errors' spread."""
_OUTLIER = 3.0
"""In standard deviations: from here a pixel's weight falls below one half."""


class Template:
    """A picture to align others to."""

    def __init__(self, picture: Picture, weights: Picture, *, same_light: bool = True) -> None:
        """Prepare a template.

        Under the same light it is fitted too how a head that nods or turns, rounder than the picture's plane, and one
        that comes nearer differ from it. What that has in common with a shift, over all pixels alike, is shift: else
        the features in the middle, which go farther, would decide. Under other light, shading would pass for it.

        Args:
            picture: (height, width).
            weights: (height, width) how much each pixel counts.
            same_light: whether pictures show the same light, but for a factor and a summand.
        """
        height, width = picture.shape
        down, right = np.gradient(picture)
        x, y = np.arange(width) + 0.5 - width / 2, (np.arange(height) + 0.5 - height / 2)[:, None]
        # A small turn from x toward y is clockwise, since y goes down.
        columns = [down * x - right * y, right, down]
        if same_light:
            round_head = x**2 + y**2
            round_head = round_head / np.average(round_head, weights=weights)
            columns += [right * round_head, down * round_head, right * x + down * y]
            columns += [picture, np.ones_like(picture)]
        self._same_light = same_light
        self._inside = weights > 0
        self._weights = weights[self._inside].astype(np.float64)
        self._jacobian = np.stack([column[self._inside] for column in columns], axis=1).astype(np.float64)
        self._picture = picture

    def align(self, picture: Picture, start: RigidTransform) -> RigidTransform:
        """The transform about the picture's centre, near `start`, that takes a picture to the template.

        It is `start` where the template shows nothing that could move.
        """
        if not self._jacobian.any():
            return start
        transform = start
        size = (picture.shape[1], picture.shape[0])
        reach = max(size) / 2
        for _ in range(_ITERATIONS):
            difference = warp_affine(picture, transform.matrix(size), size) - self._picture
            error = difference[self._inside].astype(np.float64)
            some = error[::_SAMPLED]
            scale = _OUTLIER * 1.4826 * float(np.median(np.abs(some - np.median(some)))) + 1e-9
            weighted = self._jacobian * (self._weights / (1 + (error / scale) ** 2))[:, None]
            normal = self._jacobian.T @ weighted
            step = np.linalg.solve(normal + 1e-9 * np.trace(normal) * np.eye(len(normal)), weighted.T @ error)
            turn, shift = -float(np.degrees(step[0])), step[1:3] + (step[3:5] if self._same_light else 0)
            transform = transform.then(RigidTransform(turn, float(shift[0]), float(shift[1])))
            if abs(step[0]) * reach + np.abs(shift).max() < _ENOUGH_PX:
                break
        return transform

    def correlation(self, picture: Picture, transform: RigidTransform) -> float:
        """Correlation with a picture after a transform, -1 to 1."""
        moved = warp_affine(
            picture, transform.matrix((picture.shape[1], picture.shape[0])), (picture.shape[1], picture.shape[0])
        )
        one, other = moved[self._inside].astype(np.float64), self._picture[self._inside].astype(np.float64)
        covariance = np.cov(one, other, aweights=self._weights)
        return float(covariance[0, 1] / max(np.sqrt(covariance[0, 0] * covariance[1, 1]), 1e-12))


def align_to_mean(
    pictures: Sequence[Picture], weights: Picture, start: Sequence[RigidTransform], rounds: int = 2
) -> tuple[list[RigidTransform], Template]:
    """Align pictures (height, width) of the same light to their mean, which has none of their noise.

    Args:
        pictures: at least one.
        weights: (height, width).
        start: for each the transform from which to begin.
        rounds: how often the mean is taken anew.

    Returns:
        The transforms, about the pictures' centre, and the last mean.
    """
    transforms = list(start)
    size = (weights.shape[1], weights.shape[0])
    for _ in range(rounds):
        mean = np.zeros_like(weights, np.float64)
        for picture, transform in zip(pictures, transforms, strict=True):
            mean += warp_affine(picture, transform.matrix(size), size)
        template = Template((mean / len(pictures)).astype(np.float32), weights)
        transforms = [template.align(picture, each) for picture, each in zip(pictures, transforms, strict=True)]
    return transforms, template


def gaussian_blur(picture: Picture, pixels: float) -> Picture:
    """A picture without detail finer than so many pixels (Gaussian)."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), pixels), np.float32)


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


def align_across_lights(
    pictures: Pictures,
    weights: NDArray[np.float32],
    start: Sequence[RigidTransform] | None = None,
    groups: NDArray[np.intp] | None = None,
    rounds: int = 6,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[RigidTransform]:
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
    small = np.stack([shrink(picture, scale) for picture in pictures])
    inside = without_border(shrink(weights, scale))
    transforms = [each.scaled(scale) for each in start] if start else [RigidTransform()] * count
    groups = np.arange(count) if groups is None else groups
    for done in range(rounds):
        transforms = _one_round(small, inside, transforms, groups)
        progress(done + 1, rounds)
    return [each.scaled(1 / scale) for each in transforms]


def _one_round(
    pictures: Pictures, weights: NDArray[np.float32], start: Sequence[RigidTransform], groups: NDArray[np.intp]
) -> list[RigidTransform]:
    moved = np.stack([warp_to_reference(picture, each) for picture, each in zip(pictures, start, strict=True)])
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
        moved[index] = np.maximum(warp_to_reference(picture, aligned[index]), 0)
    # Only how they lie to each other is told: on average they stay where they were.
    rows = transforms_to_array(aligned)
    return transforms_from_array(rows - rows.mean(axis=0) + transforms_to_array(start).mean(axis=0))


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
        return gaussian_blur(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), _COARSE_PX)

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
    return np.asarray(gaussian_blur(root, _FINE_PX) - mean, np.float32)


def without_border(weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Weights (height, width), 0 along the border, over which pictures move."""
    border = max(2, round(_BORDER * max(weights.shape)))
    inner = np.zeros_like(weights)
    inner[border:-border, border:-border] = weights[border:-border, border:-border]
    return inner
