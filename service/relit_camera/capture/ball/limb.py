"""A ball's outline to a fraction of a pixel, from the edges near a rough circle."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.edges import EdgeMap
from relit_camera.capture.ball.outline import Outline

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
class Limb:
    """A fitted outline.

    Attributes:
        outline: in pixels of the edge map.
        stretch: natural logarithm of its axis along the line to the picture's middle over the one across.
        stretch_error: standard error of it.
        coverage: share of the outline along which there is an edge on it; what lies outside the picture counts not.
        residual_px: root mean square distance of the edges on it.
    """

    outline: Outline
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


def fit_limb(edges: EdgeMap, rough: Outline) -> Limb | None:
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


def _edge_points(edges: EdgeMap, about: Outline, band: tuple[float, float]) -> _Edges:
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


def _consensus(points: _Edges, about: Outline) -> Outline | None:
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
    return Outline(about.x + float(across[best, 0]), about.y + float(down[best, 0]), float(radius[best, 0]))


def _fit(edges: EdgeMap, points: _Edges, about: Outline) -> Limb | None:
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
    outline = Outline(about.x + float(found[1]), about.y + float(found[2]), float(found[0]))
    covered = np.zeros(points.rays, bool)
    covered[points.ray[on_it]] = True
    angle = (np.arange(points.rays) + 0.5) * 2 * np.pi / points.rays
    x, y = outline.x + outline.radius * np.cos(angle), outline.y + outline.radius * np.sin(angle)
    inside = (x > 1) & (y > 1) & (x < width - 1) & (y < height - 1)
    coverage = float(covered[inside].mean()) if inside.any() else 0.0
    return Limb(outline, float(found[3]), float(np.sqrt(spread)) * residual, coverage, residual)
