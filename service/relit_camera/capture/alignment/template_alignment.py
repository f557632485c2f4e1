"""Template alignment: the rigid transform to a picture of the same light, or to a prediction for it, by all pixels.

`Template` minimizes the robust squared difference by Gauss-Newton steps with the template's gradient computed once
(inverse compositional; Baker and Matthews 2004).

`align_across_lights` aligns pictures of one face under different lights. Light is additive, so a picture is nearly a
weighted sum of those under similar light (Belhumeur and Kriegman 1998). The weights follow from coarse shading, which a
shift of a pixel hardly changes; fine features and texture then give the shift. Directions of the lights need not be
known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array
from relit_camera.base.images.resize import shrink
from relit_camera.capture.alignment.rigid_transform import (
    RigidTransform,
    transforms_from_array,
    transforms_to_array,
    warp_affine,
    warp_to_reference,
)

Picture = NDArray[np.float32]
Pictures = NDArray[np.float32]


@dataclass(frozen=True)
class TemplateTunables:
    """Constants of template alignment, chosen by `relit evaluate stabilisation`.

    Attributes:
        iterations: largest number of Gauss-Newton steps.
        converged_px: a step that moves no pixel farther ends them.
        residual_stride: every n-th residual enters the estimate of their spread.
        outlier_deviations: residual, in standard deviations, at which a pixel has half its weight.
        similar_pictures: number of pictures from which one is predicted.
        ridge: of that regression, as a fraction of the mean diagonal.
        fine_blur_px: standard deviation of the blur that removes detail finer than counts.
        broad_fraction: side of the squares whose mean is removed from detail, as a fraction of the picture's.
        thumbnail_side_px: side of the thumbnails that show shading alone, for the prediction's weights.
        thumbnail_blur_px: standard deviation of their blur.
        shade: summand under the root of light, as a fraction of the mean light: below it differences count no more.
        largest_side_px: larger pictures are shrunk to this.
        border_fraction: border left out, over which pictures move, as a fraction of the longer side.
    """

    iterations: int = 12
    converged_px: float = 0.01
    residual_stride: int = 7
    outlier_deviations: float = 3.0
    similar_pictures: int = 16
    ridge: float = 0.02
    fine_blur_px: float = 0.7
    broad_fraction: float = 0.15
    thumbnail_side_px: int = 48
    thumbnail_blur_px: float = 1.0
    shade: float = 0.02
    largest_side_px: int = 256
    border_fraction: float = 0.04


TUNABLES = TemplateTunables()


class Template:
    """A picture to which others are aligned."""

    def __init__(self, picture: Picture, weights: Picture, *, same_light: bool = True) -> None:
        """Prepare a template.

        Under the same light the fit includes how a head that nods, turns or comes nearer differs from the template,
        since a head is rounder than the picture plane. The part of that which all pixels have in common counts as
        shift; otherwise the features in the middle, which move farther, would decide. Under other light these terms
        are left out, because shading would be mistaken for them.

        Args:
            picture: (height, width).
            weights: (height, width) weight of each pixel.
            same_light: whether pictures show the same light, up to a factor and an offset.
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
        """The transform about the picture's center, near `start`, from a picture to the template.

        It is `start` where the template has no gradient.
        """
        if not self._jacobian.any():
            return start
        transform = start
        size = (picture.shape[1], picture.shape[0])
        reach = max(size) / 2
        for _ in range(TUNABLES.iterations):
            difference = warp_affine(picture, transform.matrix(size), size) - self._picture
            residual = difference[self._inside].astype(np.float64)
            some = residual[:: TUNABLES.residual_stride]
            scale = TUNABLES.outlier_deviations * 1.4826 * float(np.median(np.abs(some - np.median(some)))) + 1e-9
            weighted = self._jacobian * (self._weights / (1 + (residual / scale) ** 2))[:, None]
            normal = self._jacobian.T @ weighted
            step = np.linalg.solve(normal + 1e-9 * np.trace(normal) * np.eye(len(normal)), weighted.T @ residual)
            turn, shift = -float(np.degrees(step[0])), step[1:3] + (step[3:5] if self._same_light else 0)
            transform = transform.then(RigidTransform(turn, float(shift[0]), float(shift[1])))
            if abs(step[0]) * reach + np.abs(shift).max() < TUNABLES.converged_px:
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
    """Align pictures (height, width) of the same light to their mean, which is less noisy.

    Args:
        pictures: at least one.
        weights: (height, width).
        start: initial transform of each picture.
        rounds: how often the mean is computed anew.

    Returns:
        The transforms about the pictures' center, and the last mean as a template.
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
    """A picture blurred by a Gaussian with a standard deviation of `pixels`."""
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), pixels), np.float32)


def align_across_lights(
    pictures: Pictures,
    weights: NDArray[np.float32],
    start: Sequence[RigidTransform] | None = None,
    groups: NDArray[np.intp] | None = None,
    rounds: int = 6,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[RigidTransform]:
    """Transforms about the pictures' center that take each picture to the face's mean position.

    Args:
        pictures: (count, height, width) linear light, three at least.
        weights: (height, width) weight of each pixel, 0 on the background.
        start: initial transforms; the identity if not given.
        groups: (count,) group of each picture; those of one group do not predict each other, as they share errors.
        rounds: how often all pictures are predicted anew.
        progress: called with rounds done and their total.
    """
    count, height, width = pictures.shape
    scale = min(1.0, TUNABLES.largest_side_px / max(height, width))
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
        like, mixing = predict_from_similar(gram, index, groups)
        predicted = np.tensordot(mixing, moved[like], axes=1).astype(np.float32)
        shade = TUNABLES.shade * float(moved[index].mean()) + 1e-9
        template = Template(visible_detail(predicted, shade), weights, same_light=False)
        aligned.append(template.align(visible_detail(picture, shade), start[index]))
        moved[index] = np.maximum(warp_to_reference(picture, aligned[index]), 0)
    # Only relative motion can be measured, so the mean of all transforms stays what it was.
    rows = transforms_to_array(aligned)
    return transforms_from_array(rows - rows.mean(axis=0) + transforms_to_array(start).mean(axis=0))


def predict_from_similar(
    gram: Float64Array, index: int, groups: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Float64Array]:
    """Indices of the pictures most similar to one, and their weights in its prediction, by ridge regression.

    Args:
        gram: (count, count) inner products of the pictures' thumbnails.
        index: of the picture to predict.
        groups: (count,) group of each picture.
    """
    length = np.maximum(np.sqrt(gram.diagonal()), 1e-12)
    likeness = np.where(groups == groups[index], -np.inf, gram[index] / (length * length[index]))
    like = np.argsort(-likeness)[: min(TUNABLES.similar_pictures, int(np.isfinite(likeness).sum()))]
    among = gram[np.ix_(like, like)]
    ridge = TUNABLES.ridge * np.trace(among) / len(like) * np.eye(len(like))
    return like, np.linalg.solve(among + ridge, gram[like, index])


def _thumbnails(pictures: Pictures, weights: NDArray[np.float32]) -> Float64Array:
    """Small blurred pictures (count, values) that show shading without features."""
    size = (min(weights.shape[1], TUNABLES.thumbnail_side_px), min(weights.shape[0], TUNABLES.thumbnail_side_px))

    def small(picture: NDArray[np.float32]) -> NDArray[np.float32]:
        return gaussian_blur(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), TUNABLES.thumbnail_blur_px)

    # Normalized by the blurred weights, so that the edge is neither darkened nor mixed with what lies outside.
    fraction = small(weights)
    inside = np.sqrt(fraction) / np.maximum(fraction, 1e-3)
    return (
        np.stack([small(picture * weights) * inside for picture in pictures]).reshape(len(pictures), -1).astype(float)
    )


def visible_detail(light: NDArray[np.float32], shade: float) -> NDArray[np.float32]:
    """Band-pass of the square root of linear light (height, width): features, without noise and broad shading."""
    root = np.sqrt(np.maximum(light, 0) + np.float32(shade))
    mean = cv2.blur(root, 2 * [round(TUNABLES.broad_fraction * max(light.shape))])
    return np.asarray(gaussian_blur(root, TUNABLES.fine_blur_px) - mean, np.float32)


def without_border(weights: NDArray[np.float32]) -> NDArray[np.float32]:
    """Weights (height, width) set to 0 along the border, over which pictures move."""
    border = max(2, round(TUNABLES.border_fraction * max(weights.shape)))
    inner = np.zeros_like(weights)
    inner[border:-border, border:-border] = weights[border:-border, border:-border]
    return inner
