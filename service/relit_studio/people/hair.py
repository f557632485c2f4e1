"""Head hair: strands stepped along a comb, gathered into locks at two scales, with some that stray."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from relit_studio.people.face_model import FaceModel
from relit_studio.people.geometry import Floats, Indices, find_nearest, smoothstep, unit
from relit_studio.people.hair_styles import Combing, long, short
from relit_studio.people.hairs import Hairs
from relit_studio.people.scalp import Obstacle, Roots, head_and_body, place_roots
from relit_studio.people.traits import Traits

_COUNTS = {"short": 46_000, "long": 60_000, "buzz": 110_000}
_RADIUS_CM = 0.0065
_LOCKS = ((380, 0.7, 1.0, 0.28), (34, 0.88, 1.3, 0.10))
"""Two scales: hairs a lock, how far they are drawn together at the tip, how late that begins, and by how many
centimetres a whole lock's tip lies higher or lower than its neighbours'."""
_HEAD_MIDDLE = np.array([0.0, 3.0, 0.0])
_STRAYS = 0.03
"""Share of hairs that leave their lock."""


def grow_hair(model: FaceModel, head: Floats, body: Floats, traits: Traits) -> Hairs:
    """Hair on a neutral head (vertices, 3) above clothes (n, 3)."""
    rng = np.random.default_rng(traits.seed + 100)
    roots = place_roots(model, head, _COUNTS[traits.hair], rng)
    if traits.hair == "buzz":
        return _cropped(roots, rng)
    combing = short(roots, rng) if traits.hair == "short" else long(roots, rng)
    points = _combed(roots, combing, head_and_body(model, head, body), rng)
    shade = 0.35 * rng.normal(size=len(points))
    for hairs, strength, onset, lift_cm in _LOCKS:
        lock = _locks(points[:, 0], hairs, rng)
        points = _gathered(points, lock, strength, onset, lift_cm, rng)
        shade += 0.45 * rng.normal(size=len(points))[lock]
    points = _frayed(points, combing, rng)
    t = np.linspace(0, 1, combing.points)
    thick = _RADIUS_CM * rng.uniform(0.8, 1.15, (len(points), 1)) * np.interp(t, [0, 0.7, 1], [1, 1, 0.3])
    return Hairs(points, thick, shade)


def _cropped(roots: Roots, rng: np.random.Generator) -> Hairs:
    count, steps = len(roots.place), 4
    length = rng.uniform(0.3, 0.6, count) * (0.35 + 0.65 * roots.density)
    forward = 0.5 * smoothstep(roots.place[:, 1], 8, 12)
    lean = np.stack([np.zeros(count), np.full(count, -0.3), forward], axis=1)
    direction = unit(roots.normal + 0.8 * lean + 0.35 * rng.normal(size=(count, 3)))
    t = np.linspace(0, 1, steps)[None, :, None]
    curl = 0.03 * t * np.sin(5 * t + 6 * rng.random((count, 1, 3)))
    points = roots.place[:, None] + direction[:, None] * length[:, None, None] * t + curl
    return Hairs(points, np.full((count, steps), 0.0052) * np.linspace(1, 0.6, steps), 0.5 * rng.normal(size=count))


def _combed(roots: Roots, combing: Combing, obstacle: Obstacle, rng: np.random.Generator) -> Floats:
    """Polylines (n, points, 3): at each step along the comb, down, and out of the head."""
    count, last = len(roots.place), combing.points - 1
    step = (combing.length_cm / last)[:, None]
    place = roots.place.copy()
    direction = unit(roots.normal * combing.lift[:, None] + combing.direction + 0.16 * rng.normal(size=(count, 3)))
    grown = [place]
    for index in range(1, combing.points):
        along = index / last
        _, normal = obstacle.nearest(place)
        comb = combing.direction - (combing.direction * normal).sum(axis=1, keepdims=True) * normal
        hold = 0.45 * float(np.clip(1 - along / combing.loose_from, 0, 1))
        pull = combing.gravity[:, None] * np.array([0, -1, 0])
        direction = unit(direction + hold * comb + pull + 0.03 * rng.normal(size=(count, 3)))
        place = place + direction * step
        surface, normal = obstacle.nearest(place)
        wanted = combing.offset_cm * min(1, 4 * along) + combing.layer_cm * min(1, 3 * along)
        gap = ((place - surface) * normal).sum(axis=1)
        close = np.linalg.norm(place - surface, axis=1) < 4
        push = np.where(close, np.clip(wanted - gap, 0, None), 0)[:, None]
        if combing.frees_face:
            place = _out_of_face(place)
        place = place + normal * push
        direction = unit(direction + 0.5 * normal * push / step)
        grown.append(place)
    return np.stack(grown, axis=1)


def _out_of_face(place: Floats) -> Floats:
    """Points before the ears moved out and back, and those below drawn in."""
    x, y, z = place.T
    face = smoothstep(z, 2, 7) * smoothstep(9.5 - y, 0, 2) * smoothstep(8.6 - np.abs(x), 0, 2)
    x = x + 0.9 * np.sign(x) * face
    below = 0.13 * smoothstep(3.5 - y, 0, 5)
    x = x - np.sign(x) * np.clip(np.abs(x) - 7.4, 0, None) * below
    z = z - 1.1 * face + np.clip(-5.5 - z, 0, None) * below
    return np.stack([x, y, z], axis=1)


def _locks(roots: Floats, hairs: int, rng: np.random.Generator) -> Indices:
    """The hair (n,) that guides each hair; about `hairs` have the same."""
    guides = rng.choice(len(roots), max(1, len(roots) // hairs), replace=False)
    # Straight borders between locks would show.
    ragged = roots + 0.25 * np.sqrt(hairs / 400) * rng.normal(size=roots.shape)
    _, nearest = find_nearest(cKDTree(roots[guides]), ragged)
    return np.asarray(guides[nearest])


def _gathered(
    points: Floats, guide: Indices, strength: float, onset: float, lift_cm: float, rng: np.random.Generator
) -> Floats:
    """Hairs drawn to their guides, more so toward their tips; each lock lies a little higher or lower."""
    roots = points[:, 0]
    t = np.linspace(0, 1, points.shape[1])
    apart = (roots - roots[guide])[:, None] * (1 - 0.75 * t)[None, :, None]
    looseness = np.clip(rng.uniform(0.35, 1.15, (len(points), 1, 1)), 0, 1)
    weight = strength * looseness * (t**onset)[None, :, None]
    height = lift_cm * np.clip(rng.normal(size=len(points)), -0.6, 2)[guide]
    outward = unit(roots[guide] - _HEAD_MIDDLE) * height[:, None]
    goal = points[guide] + apart + outward[:, None] * t[None, :, None]
    return np.asarray(points + weight * (goal - points))


def _frayed(points: Floats, combing: Combing, rng: np.random.Generator) -> Floats:
    """Each hair's own slight wave; a few stray from their lock, some of them far and upward: flyaways."""
    count = len(points)
    t = np.linspace(0, 1, points.shape[1])[None, :, None]
    phase, amount = 6.28 * rng.random((count, 1, 3)), rng.random((count, 1, 1))
    waved = points + combing.waviness_cm * amount * t * np.sin(6.28 * combing.waves * t + phase)
    stray = rng.random(count) < _STRAYS
    far = stray & (rng.random(count) < 0.35)
    outward = unit(waved[:, -1] - _HEAD_MIDDLE)[:, None]
    reach = np.minimum(combing.length_cm, 8)[:, None, None] / 5
    drift = 0.45 * rng.normal(size=(count, 1, 3)) + far[:, None, None] * (
        0.5 * outward + 0.3 * rng.normal(size=(count, 1, 3))
    )
    return np.asarray(waved + stray[:, None, None] * drift * reach * t**1.7)
