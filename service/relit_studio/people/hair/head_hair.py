"""Head hair: combed, tied or coiled strands, gathered into locks at two scales, with some stray hairs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.base.easing import smoothstep
from relit_studio.people.face.face_model import FaceModel
from relit_studio.people.geometry import unit
from relit_studio.people.hair import hair_styles
from relit_studio.people.hair.hair_combing import Combing, combed, kept_out, out_of_face
from relit_studio.people.hair.hair_locks import Curl, Locks, curled, frayed, in_locks
from relit_studio.people.hair.hair_strands import Hairs, concatenate_hairs
from relit_studio.people.hair.scalp import Obstacle, Roots, head_and_body, place_roots
from relit_studio.people.hair.tied_hair import KNOTS, bun, drawn_back, tail
from relit_studio.people.traits.person_traits import HairStyle, Traits

HANGING = ("long", "ponytail")
"""Styles that reach the shoulders, which do not turn with the head."""
FLATTENS_EARS = ("long", "bob")
_RADIUS_CM = 0.0065


class _Style(NamedTuple):
    comb: Callable[[Roots, np.random.Generator], Combing]
    hairs: int
    locks: tuple[Locks, ...] = (Locks(380, 0.7, 1.0, 0.28), Locks(34, 0.88, 1.3, 0.10))
    curl: Curl | None = None
    coarse: float = 1.0


_CURLS = (Locks(300, 0.5, 0.8, 0.5, 0.5), Locks(60, 0.96, 0.5, 0.15, 0.4))
_TRESSES = (Locks(700, 0.75, 0.8, 0.5, 0.6), Locks(60, 0.9, 0.9, 0.2, 0.5))
_COILS = (Locks(420, 0.35, 1.0, 0.25, 0.4), Locks(40, 0.75, 0.7, 0.3, 0.5))
_DRAWN = (Locks(260, 0.5, 0.5, 0.12, 0.6), Locks(40, 0.8, 0.5, 0.06, 0.45))
_COMBED: dict[HairStyle, _Style] = {
    "short": _Style(hair_styles.short, 46_000),
    "swept": _Style(hair_styles.swept, 46_000, (Locks(260, 0.8, 0.9, 0.4, 0.5), Locks(30, 0.9, 1.2, 0.12))),
    "back": _Style(hair_styles.back, 46_000, (Locks(200, 0.85, 0.8, 0.25, 0.6), Locks(30, 0.9, 1.1, 0.08))),
    "crop": _Style(hair_styles.crop, 46_000, (Locks(170, 0.9, 0.8, 0.35, 0.6), Locks(24, 0.9, 1.0, 0.15))),
    "receding": _Style(hair_styles.receding, 24_000, (Locks(90, 0.6, 1.0, 0.1), Locks(16, 0.8, 1.0, 0.05))),
    "curly": _Style(hair_styles.curly, 40_000, _CURLS, Curl(0.38, 2.0), 1.25),
    "bob": _Style(hair_styles.bob, 46_000, _TRESSES, Curl(0.55, 6.5)),
    "long": _Style(hair_styles.long, 50_000, _TRESSES, Curl(0.6, 8.5)),
}


def grow_hair(model: FaceModel, head: Float64Array, body: Float64Array, traits: Traits, fraction: float = 1.0) -> Hairs:
    """Hair on a neutral head (vertices, 3) above clothes (n, 3); `fraction` below 1 grows less, for quick previews."""
    rng = np.random.default_rng(traits.seed + 100)
    if traits.hair in ("buzz", "bald"):
        count = 110_000 if traits.hair == "buzz" else 45_000
        return _cropped(place_roots(model, head, int(fraction * count), rng, traits.hair), rng)
    if traits.hair == "afro":
        return _coiled(place_roots(model, head, int(fraction * 42_000), rng, traits.hair), fraction, rng)
    if traits.hair in ("ponytail", "bun"):
        roots = place_roots(model, head, int(fraction * 42_000), rng, traits.hair)
        return _tied(roots, traits.hair, head_and_body(model, head, body), fraction, rng)
    style = _COMBED[traits.hair]
    roots = place_roots(model, head, int(fraction * style.hairs), rng, traits.hair)
    combing = style.comb(roots, rng)
    obstacle = head_and_body(model, head, body)
    points = combed(roots, combing, obstacle, rng)
    points, shade, guide = in_locks(points, style.locks, fraction, rng)
    if style.curl is not None:
        points = curled(points, guide, style.curl, rng)
        if combing.frees_face:
            points = out_of_face(out_of_face(points))
        points = kept_out(points, obstacle)
    points = frayed(points, combing.length_cm, combing.waviness_cm, combing.waves, rng)
    return Hairs(points, _thickness(points, rng, style.coarse), shade)


def _thickness(points: Float64Array, rng: np.random.Generator, coarse: float = 1.0) -> Float64Array:
    t = np.linspace(0, 1, points.shape[1])
    return np.asarray(
        _RADIUS_CM * coarse * rng.uniform(0.8, 1.15, (len(points), 1)) * np.interp(t, [0, 0.7, 1], [1, 1, 0.3])
    )


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


def _coiled(roots: Roots, fraction: float, rng: np.random.Generator) -> Hairs:
    """Tight coils that stand out in all directions."""
    count, steps = len(roots.place), 26
    radial = unit(roots.place - [0, 4.5, -1.5])
    low = smoothstep(roots.place[:, 1], 6, 0)
    size = rng.uniform(3.0, 6.0)
    length = size * (1 - 0.55 * low) * (0.35 + 0.65 * roots.density) * rng.uniform(0.8, 1.05, count)
    direction = unit(0.5 * roots.normal + 0.7 * radial + 0.22 * rng.normal(size=(count, 3)))
    t = np.linspace(0, 1, steps)[None, :, None]
    points = roots.place[:, None] + direction[:, None] * length[:, None, None] * t
    points, shade, guide = in_locks(points, _COILS, fraction, rng)
    points = curled(points, guide, Curl(0.2, 0.75, 0.2), rng)
    return Hairs(points, _thickness(points, rng, 1.1), shade)


def _tied(roots: Roots, style: HairStyle, obstacle: Obstacle, fraction: float, rng: np.random.Generator) -> Hairs:
    knot = KNOTS[style]
    surface, normal = obstacle.nearest(knot[None])
    knot = surface[0] + 1.1 * normal[0]
    points = drawn_back(roots, knot, obstacle, rng)
    points, shade, _ = in_locks(points, _DRAWN, fraction, rng)
    points = frayed(points, np.full(len(points), 2.0), 0.04, 1.0, rng)
    knotted = (
        tail(knot, obstacle, int(fraction * 9_000), rng)
        if style == "ponytail"
        else bun(knot, int(fraction * 12_000), rng)
    )
    tied = Hairs(knotted, _thickness(knotted, rng), 0.8 * rng.normal(size=len(knotted)))
    return concatenate_hairs([Hairs(points, _thickness(points, rng), shade), tied])
