"""Aligning a picture to another of the same light by all of its pixels.

Gauss and Newton's way, the template's gradient taken once (inverse compositional; Baker and Matthews 2004), pixels that
do not fit counting less.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.stabilise.rigid import Rigid, warp

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

    def align(self, picture: Picture, start: Rigid) -> Rigid:
        """The transform about the picture's centre, near `start`, that takes a picture to the template.

        It is `start` where the template shows nothing that could move.
        """
        if not self._jacobian.any():
            return start
        transform = start
        size = (picture.shape[1], picture.shape[0])
        reach = max(size) / 2
        for _ in range(_ITERATIONS):
            difference = warp(picture, transform.matrix(size), size) - self._picture
            error = difference[self._inside].astype(np.float64)
            some = error[::_SAMPLED]
            scale = _OUTLIER * 1.4826 * float(np.median(np.abs(some - np.median(some)))) + 1e-9
            weighted = self._jacobian * (self._weights / (1 + (error / scale) ** 2))[:, None]
            normal = self._jacobian.T @ weighted
            step = np.linalg.solve(normal + 1e-9 * np.trace(normal) * np.eye(len(normal)), weighted.T @ error)
            turn, shift = -float(np.degrees(step[0])), step[1:3] + (step[3:5] if self._same_light else 0)
            transform = transform.then(Rigid(turn, float(shift[0]), float(shift[1])))
            if abs(step[0]) * reach + np.abs(shift).max() < _ENOUGH_PX:
                break
        return transform

    def likeness(self, picture: Picture, transform: Rigid) -> float:
        """Correlation with a picture after a transform, -1 to 1."""
        moved = warp(
            picture, transform.matrix((picture.shape[1], picture.shape[0])), (picture.shape[1], picture.shape[0])
        )
        one, other = moved[self._inside].astype(np.float64), self._picture[self._inside].astype(np.float64)
        covariance = np.cov(one, other, aweights=self._weights)
        return float(covariance[0, 1] / max(np.sqrt(covariance[0, 0] * covariance[1, 1]), 1e-12))


def align_to_mean(
    pictures: Sequence[Picture], weights: Picture, start: Sequence[Rigid], rounds: int = 2
) -> tuple[list[Rigid], Template]:
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
            mean += warp(picture, transform.matrix(size), size)
        template = Template((mean / len(pictures)).astype(np.float32), weights)
        transforms = [template.align(picture, each) for picture, each in zip(pictures, transforms, strict=True)]
    return transforms, template


def smooth(picture: Picture, pixels: float) -> Picture:
    """A picture without detail finer than so many pixels (Gaussian)."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), pixels), np.float32)
