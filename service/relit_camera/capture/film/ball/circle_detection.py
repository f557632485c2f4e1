"""Circles in the picture: candidates by a Hough transform of the edges, and outlines fitted to the edges near one."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.film.ball.frame_sample import EdgeMap
from relit_camera.capture.film.ball.sphere_projection import BallOutline

MIN_RADIUS = 0.025
"""Least radius of a ball, as a fraction of the picture's shorter side: a pixel's error on a smaller one is degrees of
light."""


@dataclass(frozen=True)
class HoughTunables:
    """Search for circles; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        max_radius: largest radius, as a fraction of the picture's shorter side.
        radius_step: ratio of successive radii.
        max_side_px: longer side of the picture in which circles are searched.
        min_edge: least strength of an edge that votes.
        max_edges: most edges that vote, the strongest.
        center_error: error of a vote in radii, which sets the blur of the votes.
        peaks_per_radius: most candidates of one radius.
        min_support: least fraction of a candidate's line that lies on edges.
        min_difference: least difference of two candidates' centers and radii together, in radii.
    """

    max_radius: float = 0.65
    radius_step: float = 1.03
    max_side_px: int = 480
    min_edge: float = 0.05
    max_edges: int = 40000
    center_error: float = 0.03
    peaks_per_radius: int = 4
    min_support: float = 0.1
    min_difference: float = 0.15


@dataclass(frozen=True)
class EdgeFitTunables:
    """Fit of an outline to edges; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        step_px: distance of the samples along a ray.
        trials: circles through three points that are tried.
        min_points: least number of edge points.
        max_change: largest change of center and radius from the rough circle, in radii.
        rough_tolerance: distance in radii within which an edge supports a circle at first, since the outline is an
            ellipse.
        wide_band, narrow_band: bands about the circle in which edges count, in radii: at first, and in later fits.
        min_edge: least strength of an edge point.
        iterations: of the robust fit.
        shrink: factor of the tolerance from one iteration to the next.
        min_tolerance_px: the tolerance shrinks no further.
        inner_weight: weight of an edge inside the fitted line. Reflections next to a mirror ball's limb are squeezed
            into lines along it, so there are edges slightly inside the limb and none slightly outside.
    """

    step_px: float = 0.25
    trials: int = 400
    min_points: int = 12
    max_change: float = 0.15
    rough_tolerance: float = 0.012
    wide_band: tuple[float, float] = (0.85, 1.15)
    narrow_band: tuple[float, float] = (0.93, 1.07)
    min_edge: float = 0.03
    iterations: int = 30
    shrink: float = 0.8
    min_tolerance_px: float = 0.6
    inner_weight: float = 0.5


_HOUGH = HoughTunables()
_FIT = EdgeFitTunables()


def circle_candidates(edges: EdgeMap, count: int) -> list[BallOutline]:
    """At most `count` circles of the picture, best supported first, by the gradient Hough transform.

    For one radius after another, every edge votes for the two centers a radius away along its normal (Kimme, Ballard
    and Sklansky 1975). Votes are divided by the circle's length, so that small and large circles compare.
    """
    factor = min(1.0, _HOUGH.max_side_px / max(edges.size))
    strength, normal = edges.reduced(factor).lines()
    height, width = strength.shape
    rows, columns = np.nonzero(strength > _HOUGH.min_edge)
    if len(rows) > _HOUGH.max_edges:
        chosen = np.argpartition(-strength[rows, columns], _HOUGH.max_edges)[: _HOUGH.max_edges]
        rows, columns = rows[chosen], columns[chosen]
    weight, across = strength[rows, columns], normal[rows, columns]
    steps = int(np.log(_HOUGH.max_radius / MIN_RADIUS) / np.log(_HOUGH.radius_step)) + 1
    found: list[tuple[float, BallOutline]] = []
    for radius in MIN_RADIUS * min(height, width) * _HOUGH.radius_step ** np.arange(steps):
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
    """Support and circle of the local maxima of the votes (height, width) for one radius."""
    sigma = max(1.0, _HOUGH.center_error * radius)
    smooth = cv2.GaussianBlur(votes, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    # A complete circle gives one vote a pixel of its line; blurred, they peak at radius / sigma² in its center.
    support = smooth * np.float32(sigma**2 / radius)
    reach = 2 * int(2 * sigma) + 1
    highest = (support == cv2.dilate(support, np.ones((reach, reach), np.uint8))) & (support > _HOUGH.min_support)
    rows, columns = np.nonzero(highest)
    order = np.argsort(-support[rows, columns])[: _HOUGH.peaks_per_radius]
    return [(float(support[rows[i], columns[i]]), BallOutline(columns[i] + 0.5, rows[i] + 0.5, radius)) for i in order]


def _distinct(circles: list[BallOutline], count: int) -> list[BallOutline]:
    """The first `count` circles that differ enough from those before them."""
    kept: list[BallOutline] = []
    for circle in circles:
        if all(_difference(circle, other) > _HOUGH.min_difference for other in kept):
            kept.append(circle)
        if len(kept) == count:
            break
    return kept


def _difference(a: BallOutline, b: BallOutline) -> float:
    """Distance of the centers plus difference of the radii, in radii of the smaller circle."""
    return (float(np.hypot(a.x - b.x, a.y - b.y)) + abs(a.radius - b.radius)) / min(a.radius, b.radius)


@dataclass(frozen=True)
class OutlineFit:
    """An outline fitted to edges.

    Attributes:
        outline: in pixels of the edge map.
        coverage: fraction of the outline inside the picture along which there is an edge on it.
    """

    outline: BallOutline
    coverage: float


@dataclass(frozen=True, eq=False)
class _EdgePoints:
    """Edge points (count,) along rays from a center.

    Attributes:
        angle: of the ray, radians.
        distance: from the center, pixels.
        weight: strength of the edge, 0..1.
        ray: index of the ray.
        rays: number of rays.
    """

    angle: NDArray[np.float64]
    distance: NDArray[np.float64]
    weight: NDArray[np.float64]
    ray: NDArray[np.intp]
    rays: int


def fit_outline_to_edges(edges: EdgeMap, rough: BallOutline) -> OutlineFit | None:
    """Fit the outline of a ball to the edges near a rough circle; None where there are too few.

    Edge points are found to a fraction of a pixel along rays from the center. The circle through three points that
    most others support starts the fit (RANSAC; Fischler and Bolles 1981). Then all points count by their distance
    (M-estimator of Geman and McClure, reweighted with a shrinking tolerance), and the circle may stretch along the
    line to the picture's middle, as the projection of a ball does.
    """
    start = _consensus(_edge_points(edges, rough, _FIT.wide_band), rough)
    if start is None:
        return None
    first = _fit(edges, _edge_points(edges, start, _FIT.narrow_band), start)
    return first and _fit(edges, _edge_points(edges, first.outline, _FIT.narrow_band), first.outline)


def _edge_points(edges: EdgeMap, about: BallOutline, band: tuple[float, float]) -> _EdgePoints:
    """Local maxima of edge strength along rays from the center, in a band about the circle given in radii."""
    count = int(np.clip(2 * np.pi * about.radius, 180, 720))
    angle = (np.arange(count) + 0.5) * 2 * np.pi / count
    distance = np.arange(band[0] * about.radius, band[1] * about.radius, _FIT.step_px)
    x = about.x + distance * np.cos(angle)[:, None]
    y = about.y + distance * np.sin(angle)[:, None]
    clear = edges.along(x, y, np.broadcast_to(angle[:, None], x.shape))
    width, height = edges.size
    clear[(x < 1) | (y < 1) | (x > width - 1) | (y > height - 1)] = 0
    clear = cv2.GaussianBlur(clear, (0, 0), 1.0)
    before, here, after = clear[:, :-2], clear[:, 1:-1], clear[:, 2:]
    ray, place = np.nonzero((here >= before) & (here > after) & (here > _FIT.min_edge))
    a, b, c = (part[ray, place].astype(np.float64) for part in (before, here, after))
    top = place + 1 + 0.5 * (a - c) / (a - 2 * b + c)
    return _EdgePoints(angle[ray], distance[0] + top * _FIT.step_px, b, ray, count)


def _consensus(points: _EdgePoints, about: BallOutline) -> BallOutline | None:
    """The circle through three points that has most others near it (RANSAC); None where no circle is plausible."""
    if len(points.angle) < _FIT.min_points:
        return None
    random = np.random.default_rng(0)
    x, y = points.distance * np.cos(points.angle), points.distance * np.sin(points.angle)
    fraction = points.weight / points.weight.sum()
    three = random.choice(len(x), (_FIT.trials, 3), p=fraction)
    equations = np.stack([2 * x[three], 2 * y[three], np.ones(three.shape)], axis=2)
    equations = equations[proper := np.abs(np.linalg.det(equations)) > 1e-3 * about.radius**2]
    squares = (x[three] ** 2 + y[three] ** 2)[proper]
    across, down, rest = np.linalg.solve(equations, squares[..., None])[..., 0].T
    radius = np.sqrt(np.maximum(rest + across**2 + down**2, 0))
    near = np.hypot(across, down) < _FIT.max_change * about.radius
    near &= np.abs(radius / about.radius - 1) < _FIT.max_change
    across, down, radius = across[near, None], down[near, None], radius[near, None]
    if not len(radius):
        return None
    residual = (np.hypot(x - across, y - down) - radius) / max(1.0, _FIT.rough_tolerance * about.radius)
    # Of several edges on one ray only the best supporting one counts.
    starts = np.flatnonzero(np.diff(points.ray, prepend=-1))
    score = np.maximum.reduceat(points.weight * np.exp(-(residual**2)), starts, axis=1).sum(axis=1)
    best = int(np.argmax(score))
    return BallOutline(about.x + float(across[best, 0]), about.y + float(down[best, 0]), float(radius[best, 0]))


def _fit(edges: EdgeMap, points: _EdgePoints, about: BallOutline) -> OutlineFit | None:
    """Robust fit of radius, center and stretch to edge points about a circle."""
    if len(points.angle) < _FIT.min_points:
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
    tolerance = max(1.5, _FIT.rough_tolerance * about.radius)
    residual = points.distance - terms @ found
    for _ in range(_FIT.iterations):
        weight = points.weight / (1 + (residual / tolerance) ** 2) ** 2 * np.where(residual < 0, _FIT.inner_weight, 1.0)
        root = np.sqrt(weight)
        found = np.linalg.lstsq(terms * root[:, None], points.distance * root, rcond=None)[0]
        residual = points.distance - terms @ found
        tolerance = max(_FIT.min_tolerance_px, _FIT.shrink * tolerance)
    on_it = np.abs(residual) < 3 * tolerance
    if not on_it.any() or not 0.5 < found[0] / about.radius < 2:
        return None
    outline = BallOutline(about.x + float(found[1]), about.y + float(found[2]), float(found[0]))
    covered = np.zeros(points.rays, bool)
    covered[points.ray[on_it]] = True
    angle = (np.arange(points.rays) + 0.5) * 2 * np.pi / points.rays
    x, y = outline.x + outline.radius * np.cos(angle), outline.y + outline.radius * np.sin(angle)
    inside = (x > 1) & (y > 1) & (x < width - 1) & (y < height - 1)
    coverage = float(covered[inside].mean()) if inside.any() else 0.0
    return OutlineFit(outline, coverage)
