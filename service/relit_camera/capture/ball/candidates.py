"""Circles that the edges of a picture suggest."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.edges import EdgeMap
from relit_camera.capture.ball.outline import Outline

MIN_RADIUS = 0.025
"""Least radius, as a share of the picture's shorter side: a pixel's error on a smaller ball is degrees of light."""
MAX_RADIUS = 0.65
_RADIUS_STEP = 1.03
_WIDTH = 0.03
"""How far off, in radii, an edge may point past the middle and still be counted for it."""
_MAX_SIDE = 480
_FAINT = 0.05
_EDGES = 40000
_PER_RADIUS = 4
_LEAST_SUPPORT = 0.1


def circle_candidates(edges: EdgeMap, count: int) -> list[Outline]:
    """At most `count` circles, those first along whose line most edges lie.

    Every edge votes for the middles of the circles that it may be part of, a radius away at either side of it
    (gradient Hough transform; Kimme, Ballard and Sklansky 1975), for one radius after another. Votes are counted a
    length of the circle's line, so that small circles and large ones compare.
    """
    factor = min(1.0, _MAX_SIDE / max(edges.size))
    strength, normal = edges.reduced(factor).lines()
    height, width = strength.shape
    rows, columns = np.nonzero(strength > _FAINT)
    if len(rows) > _EDGES:
        chosen = np.argpartition(-strength[rows, columns], _EDGES)[:_EDGES]
        rows, columns = rows[chosen], columns[chosen]
    weight, across = strength[rows, columns], normal[rows, columns]
    steps = int(np.log(MAX_RADIUS / MIN_RADIUS) / np.log(_RADIUS_STEP)) + 1
    found: list[tuple[float, Outline]] = []
    for radius in MIN_RADIUS * min(height, width) * _RADIUS_STEP ** np.arange(steps):
        votes = np.zeros(height * width)
        for sign in (-radius, radius):
            x = np.rint(columns + sign * across[:, 0]).astype(np.intp)
            y = np.rint(rows + sign * across[:, 1]).astype(np.intp)
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            votes += np.bincount(y[inside] * width + x[inside], weight[inside], height * width)
        found += _peaks(votes.reshape(height, width).astype(np.float32), float(radius))
    found.sort(key=lambda pair: -pair[0])
    return [circle.scaled(1 / factor) for circle in _distinct([circle for _, circle in found], count)]


def _peaks(votes: NDArray[np.float32], radius: float) -> list[tuple[float, Outline]]:
    """The middles with most votes for this radius, each with its support."""
    sigma = max(1.0, _WIDTH * radius)
    smooth = cv2.GaussianBlur(votes, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    # A whole circle's votes, one a pixel of its line, spread over the blur, come to radius / sigma² in its middle.
    support = smooth * np.float32(sigma**2 / radius)
    reach = 2 * int(2 * sigma) + 1
    highest = (support == cv2.dilate(support, np.ones((reach, reach), np.uint8))) & (support > _LEAST_SUPPORT)
    rows, columns = np.nonzero(highest)
    order = np.argsort(-support[rows, columns])[:_PER_RADIUS]
    return [(float(support[rows[i], columns[i]]), Outline(columns[i] + 0.5, rows[i] + 0.5, radius)) for i in order]


def _distinct(circles: list[Outline], count: int) -> list[Outline]:
    """The first `count` that are not nearly the same as one before."""
    kept: list[Outline] = []
    for circle in circles:
        if all(_difference(circle, other) > 0.15 for other in kept):
            kept.append(circle)
        if len(kept) == count:
            break
    return kept


def _difference(a: Outline, b: Outline) -> float:
    return (float(np.hypot(a.x - b.x, a.y - b.y)) + abs(a.radius - b.radius)) / min(a.radius, b.radius)
