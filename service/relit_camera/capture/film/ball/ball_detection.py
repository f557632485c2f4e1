"""Whether something in the picture mirrors the lamp, wherever the lamp is.

Finding the mirror ball in pictures of a fixed scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.ball.circle_detection import (
    MIN_RADIUS,
    EdgeMap,
    OutlineFit,
    circle_candidates,
    edge_map,
    fit_outline_to_edges,
)
from relit_camera.capture.film.ball.mirror_outline import fit_mirror_outline
from relit_camera.capture.film.ball.scene_sample import SceneSample
from relit_camera.capture.film.ball.specular_highlight import Highlight, find_highlight_in_plane
from relit_camera.capture.film.ball.sphere_projection import BallOutline, DistantView
from relit_camera.capture.film.focal_length import FocalLength

_MAX_SIDE = 480
_STILL_SHARE = 0.2
_BRIGHT = 0.5
"""The mirror image of a lamp is far brighter than anything that it lights."""
_INNER = 0.9
"""Radii: there a mirror ball shows what is 128 degrees off the camera. No lamp that lights a face is farther."""
_FEW = 5
"""So few pictures do not tell what is there without the lamp."""


class SpecularHighlights:
    """Small bright places that a scene shows in some of its pictures and not in others."""

    def __init__(self, sample: SceneSample) -> None:
        """Take the scene as it is in its darker pictures, pixel by pixel, for what is there without the lamp."""
        shape = sample.codes.shape[1:]
        self._factor = min(1.0, _MAX_SIDE / max(shape))
        size = (max(1, round(shape[1] * self._factor)), max(1, round(shape[0] * self._factor)))
        self._lights = np.stack(
            [
                cv2.resize(sample.luminance(index), size, interpolation=cv2.INTER_AREA)
                for index in range(len(sample.codes))
            ]
        )
        enough = len(self._lights) >= _FEW
        self._dark = np.quantile(self._lights, _STILL_SHARE, axis=0).astype(np.float32) if enough else None

    def share(self, circle: BallOutline) -> float:
        """Share of the pictures in which one small place in this circle is bright by the lamp.

        Args:
            circle: in pixels of the sample.
        """
        small = circle.scaled(self._factor)
        view = DistantView(small)
        found = (find_highlight_in_plane(light, view, self._dark) for light in self._lights)
        glints = [place for place in found if isinstance(place, Highlight) and place.brightness > _BRIGHT]
        inner = [place for place in glints if np.hypot(place.x - small.x, place.y - small.y) < _INNER * small.radius]
        return len(inner) / len(self._lights)


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
class DetectedBall:
    """A mirror ball.

    Attributes:
        outline: in pixels of the frames.
        evidence: share of the outline that shows in the pictures. Below about 0.7 the outline may be off by several
            per cent of the radius, and the light by as many degrees. None for a circle that was given.
        glints: share of the pictures in which it shows the lamp.
        focal: of the camera: what was known, improved by the outline's shape.
    """

    outline: BallOutline
    evidence: float | None
    glints: float
    focal: FocalLength


def detect_ball(sample: SceneSample, focal: FocalLength) -> DetectedBall:
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
    return detect_balls(sample, focal, 1)[0]


def detect_balls(sample: SceneSample, focal: FocalLength, count: int) -> list[DetectedBall]:
    """At most `count` mirror balls that do not overlap, at least one, the clearest first (see `detect_ball`).

    What one's outline tells of the focal length, is known when the next is measured.

    Raises:
        CaptureError: there is none, one is cut off by the picture's edge, or over-exposed.
    """
    edges, glints = edge_map(sample), SpecularHighlights(sample)
    circles = circle_candidates(edges, _CANDIDATES)
    shares = [glints.share(circle) for circle in circles]
    enough = max(_LEAST_GLINTS, _GLINTS_OF_BEST * max(shares, default=0.0))
    limbs = _distinct(
        [fit_outline_to_edges(edges, circle) for circle, share in zip(circles, shares, strict=True) if share >= enough]
    )
    if not limbs:
        raise _nothing_found(sample, edges, circles)
    found: list[DetectedBall] = []
    for limb in limbs[:count]:
        _check_whole(limb.outline, sample)
        found.append(_measured(sample, limb.outline, glints, found[-1].focal if found else focal))
    return found


def ball_from_outline(sample: SceneSample, given: BallOutline, focal: FocalLength) -> DetectedBall:
    """A ball whose outline is given in pixels of the frames, taken as it is.

    Raises:
        CaptureError: it is cut off by the picture's edge.
    """
    circle = given.scaled(sample.scale)
    _check_whole(circle, sample)
    return DetectedBall(given, None, SpecularHighlights(sample).share(circle), focal)


def refine_ball(sample: SceneSample, given: BallOutline, focal: FocalLength) -> DetectedBall:
    """A ball whose outline is given in pixels of the frames to within a tenth of its radius, measured.

    Raises:
        CaptureError: no edge is there, or it is cut off by the picture's edge.
    """
    rough = given.scaled(sample.scale)
    _check_whole(rough, sample)
    limb = fit_outline_to_edges(edge_map(sample), rough)
    if limb is None:
        place = f"{given.x:.0f}, {given.y:.0f} with radius {given.radius:.0f}"
        raise CaptureError(
            f"there is no outline of a ball at {place}", "give the circle in pixels of the upright picture"
        )
    return _measured(sample, limb.outline, SpecularHighlights(sample), focal)


def _measured(sample: SceneSample, rough: BallOutline, glints: SpecularHighlights, focal: FocalLength) -> DetectedBall:
    known = focal.scaled(sample.scale)
    limb = fit_mirror_outline(sample.averages(_AVERAGES), rough, known.log, known.error)
    better = limb.log_focal_error < 0.8 * focal.error
    source = focal.source if focal.source.endswith(_CORRECTED) or not better else focal.source + _CORRECTED
    pixels = float(np.exp(limb.log_focal)) / sample.scale
    return DetectedBall(
        limb.outline.scaled(1 / sample.scale),
        limb.evidence,
        glints.share(limb.outline),
        FocalLength(pixels, limb.log_focal_error, source) if better else focal,
    )


def _significance(limb: OutlineFit) -> float:
    """How unlikely it is that so much of a circle's line lies on edges by chance, as a logarithm.

    After the a-contrario validation of Desolneux, Moisan and Morel (2000): Chernoff's bound of the binomial tail. Every
    other pixel of the line counts as independent.
    """
    p, q = min(max(limb.coverage, _CHANCE_COVERAGE), 0.999), _CHANCE_COVERAGE
    return float(np.pi * limb.outline.radius * (p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q))))


def _distinct(limbs: list[OutlineFit | None]) -> list[OutlineFit]:
    """The significant ones that do not overlap a more significant one, the most significant first."""
    significant = [limb for limb in limbs if limb is not None and _significance(limb) > _LEAST_SIGNIFICANCE]
    kept: list[OutlineFit] = []
    for limb in sorted(significant, key=_significance, reverse=True):
        a = limb.outline
        if all(np.hypot(a.x - b.outline.x, a.y - b.outline.y) > a.radius + b.outline.radius for b in kept):
            kept.append(limb)
    return kept


def _check_whole(outline: BallOutline, sample: SceneSample) -> None:
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


def _nothing_found(sample: SceneSample, edges: EdgeMap, circles: list[BallOutline]) -> CaptureError:
    """Why no circle counts as a ball: one that is white all over, one that shows no lamp, or none at all."""
    limbs = _distinct([fit_outline_to_edges(edges, circle) for circle in circles])
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
