"""Finding the mirror ball in pictures of a fixed scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relit_camera.capture.ball.candidates import MIN_RADIUS, circle_candidates
from relit_camera.capture.ball.edges import EdgeMap, edge_map
from relit_camera.capture.ball.focal import Focal
from relit_camera.capture.ball.glints import Glints
from relit_camera.capture.ball.limb import Limb, fit_limb
from relit_camera.capture.ball.mirror_limb import fit_mirror_limb
from relit_camera.capture.ball.outline import Outline
from relit_camera.capture.ball.sample import SceneSample
from relit_camera.errors import CaptureError

_CANDIDATES = 100
_LEAST_GLINTS, _GLINTS_OF_BEST = 0.15, 0.6
"""Share of the pictures in which a ball shows the lamp: at least, and of what the circle with most has."""
_LEAST_SIGNIFICANCE = 8.0
_CHANCE_COVERAGE = 0.5
"""Share of a circle that lies on edges by chance, in a busy picture."""
_CUT_OFF = 0.02
_CLIPPED, _MOSTLY = 250, 0.4
_AVERAGES = 6
_CORRECTED = "; corrected by the ball's outline"


@dataclass(frozen=True)
class FoundBall:
    """A mirror ball.

    Attributes:
        outline: in pixels of the frames.
        evidence: share of the outline that shows in the pictures. Below about 0.7 the outline may be off by several
            per cent of the radius, and the light by as many degrees. None for a circle that was given.
        glints: share of the pictures in which it shows the lamp.
        focal: of the camera: what was known, improved by the outline's shape.
    """

    outline: Outline
    evidence: float | None
    glints: float
    focal: Focal


def find_ball(sample: SceneSample, focal: Focal) -> FoundBall:
    """Find the mirror ball: a round thing in which, whatever way the lamp is, one small place is very bright.

    Circles that the scene's edges suggest are tried; of those with glints the one counts that has most edge on its line
    for its size, and its outline is fitted as a mirror's.

    Args:
        sample: of the video's frames, dark and bright, or of photographs under several lights. A single one is taken at
            its word: the best circle with a bright place in it.
        focal: the camera's, as far as it is known.

    Raises:
        CaptureError: there is none, it is cut off by the picture's edge, or over-exposed.
    """
    return find_balls(sample, focal, 1)[0]


def find_balls(sample: SceneSample, focal: Focal, count: int) -> list[FoundBall]:
    """At most `count` mirror balls that do not overlap, at least one, the clearest first (see `find_ball`).

    What one's outline tells of the focal length, is known when the next is measured.

    Raises:
        CaptureError: there is none, one is cut off by the picture's edge, or over-exposed.
    """
    edges, glints = edge_map(sample), Glints(sample)
    circles = circle_candidates(edges, _CANDIDATES)
    shares = [glints.share(circle) for circle in circles]
    enough = max(_LEAST_GLINTS, _GLINTS_OF_BEST * max(shares, default=0.0))
    limbs = _distinct(
        [fit_limb(edges, circle) for circle, share in zip(circles, shares, strict=True) if share >= enough]
    )
    if not limbs:
        raise _nothing_found(sample, edges, circles)
    found: list[FoundBall] = []
    for limb in limbs[:count]:
        _check_whole(limb.outline, sample)
        found.append(_measured(sample, limb.outline, glints, found[-1].focal if found else focal))
    return found


def given_ball(sample: SceneSample, given: Outline, focal: Focal) -> FoundBall:
    """A ball whose outline is given in pixels of the frames, taken as it is.

    Raises:
        CaptureError: it is cut off by the picture's edge.
    """
    circle = given.scaled(sample.scale)
    _check_whole(circle, sample)
    return FoundBall(given, None, Glints(sample).share(circle), focal)


def refine_ball(sample: SceneSample, given: Outline, focal: Focal) -> FoundBall:
    """A ball whose outline is given in pixels of the frames to within a tenth of its radius, measured.

    Raises:
        CaptureError: no edge is there, or it is cut off by the picture's edge.
    """
    rough = given.scaled(sample.scale)
    _check_whole(rough, sample)
    limb = fit_limb(edge_map(sample), rough)
    if limb is None:
        place = f"{given.x:.0f}, {given.y:.0f} with radius {given.radius:.0f}"
        raise CaptureError(
            f"there is no outline of a ball at {place}", "give the circle in pixels of the upright picture"
        )
    return _measured(sample, limb.outline, Glints(sample), focal)


def _measured(sample: SceneSample, rough: Outline, glints: Glints, focal: Focal) -> FoundBall:
    known = focal.scaled(sample.scale)
    limb = fit_mirror_limb(sample.averages(_AVERAGES), rough, known.log, known.error)
    better = limb.log_focal_error < 0.8 * focal.error
    source = focal.source if focal.source.endswith(_CORRECTED) or not better else focal.source + _CORRECTED
    pixels = float(np.exp(limb.log_focal)) / sample.scale
    return FoundBall(
        limb.outline.scaled(1 / sample.scale),
        limb.evidence,
        glints.share(limb.outline),
        Focal(pixels, limb.log_focal_error, source) if better else focal,
    )


def _significance(limb: Limb) -> float:
    """How unlikely it is that so much of a circle's line lies on edges by chance, as a logarithm.

    After the a-contrario validation of Desolneux, Moisan and Morel (2000): Chernoff's bound of the binomial tail. Every
    other pixel of the line counts as independent.
    """
    p, q = min(max(limb.coverage, _CHANCE_COVERAGE), 0.999), _CHANCE_COVERAGE
    return float(np.pi * limb.outline.radius * (p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q))))


def _distinct(limbs: list[Limb | None]) -> list[Limb]:
    """The significant ones that do not overlap a more significant one, the most significant first."""
    significant = [limb for limb in limbs if limb is not None and _significance(limb) > _LEAST_SIGNIFICANCE]
    kept: list[Limb] = []
    for limb in sorted(significant, key=_significance, reverse=True):
        a = limb.outline
        if all(np.hypot(a.x - b.outline.x, a.y - b.outline.y) > a.radius + b.outline.radius for b in kept):
            kept.append(limb)
    return kept


def _check_whole(outline: Outline, sample: SceneSample) -> None:
    height, width = sample.codes.shape[1:]
    reach = (1 - _CUT_OFF) * outline.radius
    over = {
        "left": reach - outline.x,
        "right": outline.x + reach - width,
        "top": reach - outline.y,
        "bottom": outline.y + reach - height,
    }
    side = max(over, key=lambda name: over[name])
    if over[side] > 0:
        place = outline.scaled(1 / sample.scale)
        raise CaptureError(
            f"the mirror ball at {place.x:.0f}, {place.y:.0f} is cut off by the picture's {side} edge",
            "film it again with all of the ball in the picture",
        )


def _nothing_found(sample: SceneSample, edges: EdgeMap, circles: list[Outline]) -> CaptureError:
    """Why no circle counts as a ball: one that is white all over, one that shows no lamp, or none at all."""
    limbs = _distinct([fit_limb(edges, circle) for circle in circles])
    usual = np.median(sample.codes, axis=0)
    for limb in limbs:
        outline = limb.outline
        rows, columns = outline.pixels_within(1.0, (usual.shape[1], usual.shape[0]))
        place = outline.scaled(1 / sample.scale)
        where = f"at {place.x:.0f}, {place.y:.0f} with radius {place.radius:.0f}"
        if np.mean(usual[rows, columns] > _CLIPPED) > _MOSTLY:
            return CaptureError(
                f"the ball {where} is over-exposed: most of it is white",
                "lower the exposure and lock it, or turn off lamps that the ball shows",
            )
    smallest = 2 * MIN_RADIUS * min(sample.size)
    cure = (
        f"put a shiny ball of at least {smallest:.0f} pixels beside the head, before something plain, "
        "or give its circle: --ball X,Y,RADIUS"
    )
    return CaptureError("no mirror ball was found: nothing round shows the moving light as a small bright place", cure)
