"""Edges that stay in place while the light moves.

Circles that the edges of a picture suggest.

A ball's outline to a fraction of a pixel, from the edges near a rough circle.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.ball.scene_sample import SceneSample
from relit_camera.capture.film.ball.sphere_projection import BallOutline

_BLUR_PX = 1.0
_AROUND_PX = 7
"""Side of the window whose brightest pixel a gradient is measured by."""
_BLACK = 0.003
"""Luminance below which differences are noise."""
_CONTRAST = 0.04
"""An edge with this share of the brightness a pixel counts half."""

Plane = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class EdgeMap:
    """Where a scene has edges: the mean over its pictures of the gradient's outer product with itself.

    So an edge counts where it is now brighter and now darker than what is beside it, as a ball's limb is when the
    light moves. Each gradient is taken in linear light, in which a blurred edge stays where it is, in shares of the
    brightness there, and counts between 0 and 1.

    Attributes:
        xx, xy, yy: float32 (height, width), the tensor's parts.
    """

    xx: Plane
    xy: Plane
    yy: Plane

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.xx.shape[1], self.xx.shape[0]

    def reduced(self, factor: float) -> EdgeMap:
        """The same for a picture of `factor` (at most 1) times as many pixels along each side."""
        size = (max(1, round(self.size[0] * factor)), max(1, round(self.size[1] * factor)))
        return EdgeMap(*(cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in (self.xx, self.xy, self.yy)))

    def lines(self) -> tuple[Plane, Plane]:
        """Strength 0..1 (height, width), 0 but on the ridge of each edge; and the unit normal (height, width, 2)."""
        angle = 0.5 * np.arctan2(2 * self.xy, self.xx - self.yy)
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        strength = self.xx + self.yy
        rows, columns = np.indices(strength.shape, dtype=np.float32)
        sides = [
            cv2.remap(strength, columns + sign * normal[..., 0], rows + sign * normal[..., 1], cv2.INTER_LINEAR)
            for sign in (-1, 1)
        ]
        return np.where((strength >= sides[0]) & (strength >= sides[1]), strength, np.float32(0)), normal

    def along(self, x: NDArray, y: NDArray, angle: NDArray) -> Plane:
        """How clear an edge across the direction `angle` (radians, from x toward y) is at pixels x, y (all (h, w))."""
        parts = [
            cv2.remap(part, (x - 0.5).astype(np.float32), (y - 0.5).astype(np.float32), cv2.INTER_LINEAR)
            for part in (self.xx, self.xy, self.yy)
        ]
        cos, sin = np.cos(angle), np.sin(angle)
        return np.asarray(cos * cos * parts[0] + 2 * cos * sin * parts[1] + sin * sin * parts[2], np.float32)


def edge_map(sample: SceneSample) -> EdgeMap:
    """The edges that the pictures of a sample have in common."""
    xx, xy, yy = (np.zeros(sample.codes.shape[1:], np.float32) for _ in range(3))
    for index in range(len(sample.codes)):
        light = cv2.GaussianBlur(sample.luminance(index), (0, 0), _BLUR_PX)
        level = cv2.dilate(light, np.ones((_AROUND_PX, _AROUND_PX), np.uint8)) + np.float32(_BLACK)
        dx, dy = cv2.Scharr(light, cv2.CV_32F, 1, 0) / 32 / level, cv2.Scharr(light, cv2.CV_32F, 0, 1) / 32 / level
        clear = 1 / (dx * dx + dy * dy + np.float32(_CONTRAST**2))
        xx += dx * dx * clear
        xy += dx * dy * clear
        yy += dy * dy * clear
    count = np.float32(len(sample.codes))
    return EdgeMap(xx / count, xy / count, yy / count)


MIN_RADIUS = 0.025
"""Least radius, as a share of the picture's shorter side: a pixel's error on a smaller ball is degrees of light."""
MAX_RADIUS = 0.65
_RADIUS_STEP = 1.03
_WIDTH = 0.03
"""How far off, in radii, an edge may point past the middle and still be counted for it."""
_MAX_SIDE = 480
_WEAK_EDGE_STRENGTH = 0.05
_EDGES = 40000
_PER_RADIUS = 4
_LEAST_SUPPORT = 0.1


def circle_candidates(edges: EdgeMap, count: int) -> list[BallOutline]:
    """At most `count` circles, those first along whose line most edges lie.

    Every edge votes for the middles of the circles that it may be part of, a radius away at either side of it
    (gradient Hough transform; Kimme, Ballard and Sklansky 1975), for one radius after another. Votes are counted a
    length of the circle's line, so that small circles and large ones compare.
    """
    factor = min(1.0, _MAX_SIDE / max(edges.size))
    strength, normal = edges.reduced(factor).lines()
    height, width = strength.shape
    rows, columns = np.nonzero(strength > _WEAK_EDGE_STRENGTH)
    if len(rows) > _EDGES:
        chosen = np.argpartition(-strength[rows, columns], _EDGES)[:_EDGES]
        rows, columns = rows[chosen], columns[chosen]
    weight, across = strength[rows, columns], normal[rows, columns]
    steps = int(np.log(MAX_RADIUS / MIN_RADIUS) / np.log(_RADIUS_STEP)) + 1
    found: list[tuple[float, BallOutline]] = []
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


def _peaks(votes: NDArray[np.float32], radius: float) -> list[tuple[float, BallOutline]]:
    """The middles with most votes for this radius, each with its support."""
    sigma = max(1.0, _WIDTH * radius)
    smooth = cv2.GaussianBlur(votes, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    # A whole circle's votes, one a pixel of its line, spread over the blur, come to radius / sigma² in its middle.
    support = smooth * np.float32(sigma**2 / radius)
    reach = 2 * int(2 * sigma) + 1
    highest = (support == cv2.dilate(support, np.ones((reach, reach), np.uint8))) & (support > _LEAST_SUPPORT)
    rows, columns = np.nonzero(highest)
    order = np.argsort(-support[rows, columns])[:_PER_RADIUS]
    return [(float(support[rows[i], columns[i]]), BallOutline(columns[i] + 0.5, rows[i] + 0.5, radius)) for i in order]


def _distinct(circles: list[BallOutline], count: int) -> list[BallOutline]:
    """The first `count` that are not nearly the same as one before."""
    kept: list[BallOutline] = []
    for circle in circles:
        if all(_difference(circle, other) > 0.15 for other in kept):
            kept.append(circle)
        if len(kept) == count:
            break
    return kept


def _difference(a: BallOutline, b: BallOutline) -> float:
    return (float(np.hypot(a.x - b.x, a.y - b.y)) + abs(a.radius - b.radius)) / min(a.radius, b.radius)


_STEP_PX = 0.25
_TRIALS = 400
_LEAST_POINTS = 12
_FAR = 0.15
"""Share of the radius by which middle and radius may be off at first."""
_ROUGH = 0.012
"""Share of the radius within which an edge is near a circle at first: a ball's outline is an ellipse."""
_WIDE, _NARROW = (0.85, 1.15), (0.93, 1.07)
"""Bands about the circle that are looked at, in radii: at first, and once it is known better."""
_FAINT = 0.03
_ROUNDS = 30
_SHRINK = 0.8
_LEAST_TOLERANCE_PX = 0.6
_INWARD = 0.5
"""Weight of an edge inside the fitted line. What a ball mirrors next to its limb is squeezed into lines along it: there
are edges a little inside the limb, and none a little outside."""


@dataclass(frozen=True)
class OutlineFit:
    """A fitted outline.

    Attributes:
        outline: in pixels of the edge map.
        stretch: natural logarithm of its axis along the line to the picture's middle over the one across.
        stretch_error: standard error of it.
        coverage: share of the outline along which there is an edge on it; what lies outside the picture counts not.
        residual_px: root mean square distance of the edges on it.
    """

    outline: BallOutline
    stretch: float
    stretch_error: float
    coverage: float
    residual_px: float


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edge points about a middle: angle (radians), distance in pixels, clearness 0..1, index of the angle; (count,)."""

    angle: NDArray[np.float64]
    distance: NDArray[np.float64]
    weight: NDArray[np.float64]
    ray: NDArray[np.intp]
    rays: int


def fit_outline_to_edges(edges: EdgeMap, rough: BallOutline) -> OutlineFit | None:
    """Fit the outline of a ball to the edges near a rough circle; None where they make none.

    Edge points are found to a fraction of a pixel along rays from the middle. The circle through three of them with
    most others near it starts the fit (RANSAC; Fischler and Bolles 1981); then all count by their distance (Geman and
    McClure's M-estimator, iterated with a shrinking tolerance), and the circle may stretch along the line to the
    picture's middle, as a ball's picture does.
    """
    start = _consensus(_edge_points(edges, rough, _WIDE), rough)
    if start is None:
        return None
    limb = _fit(edges, _edge_points(edges, start, _NARROW), start)
    return limb and _fit(edges, _edge_points(edges, limb.outline, _NARROW), limb.outline)


def _edge_points(edges: EdgeMap, about: BallOutline, band: tuple[float, float]) -> _Edges:
    count = int(np.clip(2 * np.pi * about.radius, 180, 720))
    angle = (np.arange(count) + 0.5) * 2 * np.pi / count
    distance = np.arange(band[0] * about.radius, band[1] * about.radius, _STEP_PX)
    x = about.x + distance * np.cos(angle)[:, None]
    y = about.y + distance * np.sin(angle)[:, None]
    clear = edges.along(x, y, np.broadcast_to(angle[:, None], x.shape))
    width, height = edges.size
    clear[(x < 1) | (y < 1) | (x > width - 1) | (y > height - 1)] = 0
    clear = cv2.GaussianBlur(clear, (0, 0), 1.0)
    before, here, after = clear[:, :-2], clear[:, 1:-1], clear[:, 2:]
    ray, place = np.nonzero((here >= before) & (here > after) & (here > _FAINT))
    a, b, c = (part[ray, place].astype(np.float64) for part in (before, here, after))
    top = place + 1 + 0.5 * (a - c) / (a - 2 * b + c)
    return _Edges(angle[ray], distance[0] + top * _STEP_PX, b, ray, count)


def _consensus(points: _Edges, about: BallOutline) -> BallOutline | None:
    """The circle through three points that most others are near to."""
    if len(points.angle) < _LEAST_POINTS:
        return None
    chance = np.random.default_rng(0)
    x, y = points.distance * np.cos(points.angle), points.distance * np.sin(points.angle)
    share = points.weight / points.weight.sum()
    three = chance.choice(len(x), (_TRIALS, 3), p=share)
    equations = np.stack([2 * x[three], 2 * y[three], np.ones(three.shape)], axis=2)
    equations = equations[proper := np.abs(np.linalg.det(equations)) > 1e-3 * about.radius**2]
    squares = (x[three] ** 2 + y[three] ** 2)[proper]
    across, down, rest = np.linalg.solve(equations, squares[..., None])[..., 0].T
    radius = np.sqrt(np.maximum(rest + across**2 + down**2, 0))
    near = (np.hypot(across, down) < _FAR * about.radius) & (np.abs(radius / about.radius - 1) < _FAR)
    across, down, radius = across[near, None], down[near, None], radius[near, None]
    if not len(radius):
        return None
    off = (np.hypot(x - across, y - down) - radius) / max(1.0, _ROUGH * about.radius)
    # Of several edges on one ray only the nearest counts.
    starts = np.flatnonzero(np.diff(points.ray, prepend=-1))
    score = np.maximum.reduceat(points.weight * np.exp(-(off**2)), starts, axis=1).sum(axis=1)
    best = int(np.argmax(score))
    return BallOutline(about.x + float(across[best, 0]), about.y + float(down[best, 0]), float(radius[best, 0]))


def _fit(edges: EdgeMap, points: _Edges, about: BallOutline) -> OutlineFit | None:
    if len(points.angle) < _LEAST_POINTS:
        return None
    width, height = edges.size
    away = np.arctan2(about.y - height / 2, about.x - width / 2)
    terms = np.stack(
        [
            np.ones_like(points.angle),
            np.cos(points.angle),
            np.sin(points.angle),
            about.radius / 2 * np.cos(2 * (points.angle - away)),
        ],
        axis=1,
    )
    found = np.array([about.radius, 0.0, 0.0, 0.0])
    tolerance = max(1.5, _ROUGH * about.radius)
    off = points.distance - terms @ found
    weight = points.weight
    for _ in range(_ROUNDS):
        weight = points.weight / (1 + (off / tolerance) ** 2) ** 2 * np.where(off < 0, _INWARD, 1.0)
        root = np.sqrt(weight)
        found = np.linalg.lstsq(terms * root[:, None], points.distance * root, rcond=None)[0]
        off = points.distance - terms @ found
        tolerance = max(_LEAST_TOLERANCE_PX, _SHRINK * tolerance)
    on_it = np.abs(off) < 3 * tolerance
    if not on_it.any() or not 0.5 < found[0] / about.radius < 2:
        return None
    residual = float(np.sqrt(np.average(off[on_it] ** 2, weights=weight[on_it])))
    spread = np.linalg.pinv((terms * weight[:, None]).T @ terms)[3, 3]
    outline = BallOutline(about.x + float(found[1]), about.y + float(found[2]), float(found[0]))
    covered = np.zeros(points.rays, bool)
    covered[points.ray[on_it]] = True
    angle = (np.arange(points.rays) + 0.5) * 2 * np.pi / points.rays
    x, y = outline.x + outline.radius * np.cos(angle), outline.y + outline.radius * np.sin(angle)
    inside = (x > 1) & (y > 1) & (x < width - 1) & (y < height - 1)
    coverage = float(covered[inside].mean()) if inside.any() else 0.0
    return OutlineFit(outline, float(found[3]), float(np.sqrt(spread)) * residual, coverage, residual)
