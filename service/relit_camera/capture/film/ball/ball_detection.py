"""Finding the mirror balls in a sample of a film's frames.

Circles that the edges suggest are tried. Those in which one small place is bright wherever the lamp is
(`HighlightVisibility`) and whose line lies on significantly many edges are balls; `fit_mirror_outline` then measures
their outlines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.ball.circle_detection import (
    MIN_RADIUS,
    OutlineFit,
    circle_candidates,
    fit_outline_to_edges,
)
from relit_camera.capture.film.ball.frame_sample import EdgeMap, FrameSample, edge_map
from relit_camera.capture.film.ball.mirror_outline import fit_mirror_outline
from relit_camera.capture.film.ball.specular_highlight import Highlight, find_highlight
from relit_camera.capture.film.ball.sphere_projection import BallOutline, DistantView
from relit_camera.capture.film.focal_length import FocalLength


@dataclass(frozen=True)
class DetectionTunables:
    """What counts as a ball; `relit evaluate capture` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        max_side_px: longer side of the pictures in which highlights are looked for.
        dark_quantile: quantile of a pixel's brightness over the pictures that stands for the scene without the lamp.
        min_pictures: fewer pictures do not show the scene without the lamp.
        min_brightness: least brightness of the lamp's mirror image, which is far brighter than what the lamp lights.
        inner_radius: radii within which a highlight counts. At 0.9 a mirror ball shows what is 128 degrees off the
            camera's axis; no lamp that lights a face is farther off.
        candidates: circles that are tried.
        min_visibility: least fraction of the pictures in which a ball shows the lamp.
        min_relative_visibility: the same relative to the circle with the largest fraction.
        min_significance: least significance of a ball's outline.
        chance_coverage: fraction of a circle's line that lies on edges by chance in a busy picture.
        cut_off: radii by which an outline may exceed the picture.
        white_code, max_white: a ball is over-exposed if more than this fraction of it has codes above this one.
        averages: pictures to which the sample is averaged before its outlines are measured.
        max_error_ratio: the focal length is taken from the outline if that reduces its error to this fraction.
    """

    max_side_px: int = 480
    dark_quantile: float = 0.2
    min_pictures: int = 5
    min_brightness: float = 0.5
    inner_radius: float = 0.9
    candidates: int = 100
    min_visibility: float = 0.15
    min_relative_visibility: float = 0.6
    min_significance: float = 8.0
    chance_coverage: float = 0.5
    cut_off: float = 0.02
    white_code: int = 250
    max_white: float = 0.4
    averages: int = 6
    max_error_ratio: float = 0.8


_TUNABLES = DetectionTunables()
_CORRECTED = "; corrected by the ball's outline"


@dataclass(frozen=True)
class DetectedBall:
    """A mirror ball.

    Attributes:
        outline: in pixels of the frames.
        evidence: fraction of the outline that is visible in the pictures. Below about 0.7 the outline may be off by
            several per cent of the radius, and the light by as many degrees. None for a circle that was given.
        highlight_visibility: fraction of the pictures in which the ball shows the lamp.
        focal: focal length of the camera, corrected by the outline's shape where that is more accurate.
    """

    outline: BallOutline
    evidence: float | None
    highlight_visibility: float
    focal: FocalLength


class HighlightVisibility:
    """How often a circle of the scene shows a small bright place that the scene without the lamp does not have."""

    def __init__(self, sample: FrameSample) -> None:
        """Take the scene without the lamp from the darker pictures, pixel by pixel."""
        shape = sample.codes.shape[1:]
        self._factor = min(1.0, _TUNABLES.max_side_px / max(shape))
        size = (max(1, round(shape[1] * self._factor)), max(1, round(shape[0] * self._factor)))
        self._lights = np.stack(
            [
                cv2.resize(sample.luminance(index), size, interpolation=cv2.INTER_AREA)
                for index in range(len(sample.codes))
            ]
        )
        enough = len(self._lights) >= _TUNABLES.min_pictures
        dark = np.quantile(self._lights, _TUNABLES.dark_quantile, axis=0).astype(np.float32) if enough else None
        self._dark = dark

    def fraction(self, circle: BallOutline) -> float:
        """Fraction of the pictures in which the lamp makes one small place in this circle bright.

        Args:
            circle: in pixels of the sample.
        """
        small = circle.scaled(self._factor)
        view = DistantView(small)
        found = (find_highlight(light, view, self._dark) for light in self._lights)
        bright = [each for each in found if isinstance(each, Highlight) and each.brightness > _TUNABLES.min_brightness]
        reach = _TUNABLES.inner_radius * small.radius
        inner = [each for each in bright if np.hypot(each.x - small.x, each.y - small.y) < reach]
        return len(inner) / len(self._lights)


def find_balls(
    sample: FrameSample, focal: FocalLength, count: int = 1, given: Sequence[BallOutline] = ()
) -> list[DetectedBall]:
    """The mirror balls of a film: those given, then those found, the clearest first.

    Args:
        sample: of the film's dark and bright frames.
        focal: focal length of the camera, as far as it is known.
        count: number of balls that must be there, 1 or 2.
        given: outlines in pixels of the frames, where they are known.

    Raises:
        CaptureError: there are fewer, or one is cut off by the picture's edge or over-exposed.
    """
    known = [ball_from_outline(sample, outline, focal) for outline in given]
    if len(known) >= count:
        return known
    found = [
        ball
        for ball in detect_balls(sample, focal, count)
        if not any(ball.outline.overlaps(other.outline) for other in known)
    ]
    balls = [*known, *found][:count]
    if len(balls) < count:
        raise CaptureError(
            f"only one mirror ball was found, at {balls[0].outline.x:.0f}, {balls[0].outline.y:.0f}, not two",
            "film the second on the other side of the head, all of it in the picture and before something plain, or "
            "give its circle, --second-ball X,Y,RADIUS; or leave --balls 2 out",
        )
    return balls


def ball_from_outline(sample: FrameSample, given: BallOutline, focal: FocalLength) -> DetectedBall:
    """A ball whose outline is given in pixels of the frames, taken as it is.

    Raises:
        CaptureError: it is cut off by the picture's edge.
    """
    circle = given.scaled(sample.scale)
    _require_whole(circle, sample)
    return DetectedBall(given, None, HighlightVisibility(sample).fraction(circle), focal)


def detect_balls(sample: FrameSample, focal: FocalLength, count: int) -> list[DetectedBall]:
    """At most `count` mirror balls that do not overlap, at least one, the most significant first.

    The focal length that the first outline corrects is used in measuring the next.

    Args:
        sample: of a film's frames, dark and bright, or of photographs under several lights. Of a single photograph, the
            best circle with a bright place in it is taken.
        focal: focal length of the camera, as far as it is known.
        count: most balls to find.

    Raises:
        CaptureError: there is none, one is cut off by the picture's edge, or over-exposed.
    """
    edges, visibility = edge_map(sample), HighlightVisibility(sample)
    circles = circle_candidates(edges, _TUNABLES.candidates)
    fractions = [visibility.fraction(circle) for circle in circles]
    enough = max(_TUNABLES.min_visibility, _TUNABLES.min_relative_visibility * max(fractions, default=0.0))
    showing = [circle for circle, fraction in zip(circles, fractions, strict=True) if fraction >= enough]
    fits = _significant([fit_outline_to_edges(edges, circle) for circle in showing])
    if not fits:
        raise _nothing_found(sample, edges, circles)
    found: list[DetectedBall] = []
    for fit in fits[:count]:
        _require_whole(fit.outline, sample)
        found.append(_measure(sample, fit.outline, visibility, found[-1].focal if found else focal))
    return found


def _measure(
    sample: FrameSample, rough: BallOutline, visibility: HighlightVisibility, focal: FocalLength
) -> DetectedBall:
    """A ball with this rough outline in pixels of the sample, its outline and the focal length measured."""
    known = focal.scaled(sample.scale)
    fit = fit_mirror_outline(sample.averages(_TUNABLES.averages), rough, known.log, known.error)
    better = fit.log_focal_error < _TUNABLES.max_error_ratio * focal.error
    source = focal.source if focal.source.endswith(_CORRECTED) or not better else focal.source + _CORRECTED
    pixels = float(np.exp(fit.log_focal)) / sample.scale
    return DetectedBall(
        fit.outline.scaled(1 / sample.scale),
        fit.evidence,
        visibility.fraction(fit.outline),
        FocalLength(pixels, fit.log_focal_error, source) if better else focal,
    )


def _significance(fit: OutlineFit) -> float:
    """Negative logarithm of the probability that so much of a circle's line lies on edges by chance.

    After the a-contrario validation of Desolneux, Moisan and Morel (2000): Chernoff's bound of the binomial tail. Every
    other pixel of the line counts as independent.
    """
    q = _TUNABLES.chance_coverage
    p = min(max(fit.coverage, q), 0.999)
    return float(np.pi * fit.outline.radius * (p * np.log(p / q) + (1 - p) * np.log((1 - p) / (1 - q))))


def _significant(fits: list[OutlineFit | None]) -> list[OutlineFit]:
    """The significant outlines that do not overlap a more significant one, the most significant first."""
    significant = [fit for fit in fits if fit is not None and _significance(fit) > _TUNABLES.min_significance]
    kept: list[OutlineFit] = []
    for fit in sorted(significant, key=_significance, reverse=True):
        if not any(fit.outline.overlaps(other.outline) for other in kept):
            kept.append(fit)
    return kept


def _require_whole(outline: BallOutline, sample: FrameSample) -> None:
    """Check that a ball with this outline, in pixels of the sample, is inside the picture.

    Raises:
        CaptureError: it is cut off.
    """
    height, width = sample.codes.shape[1:]
    reach = (1 - _TUNABLES.cut_off) * outline.radius
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


def _nothing_found(sample: FrameSample, edges: EdgeMap, circles: list[BallOutline]) -> CaptureError:
    """Why no circle counts as a ball: the clearest one is white all over, or none shows the lamp."""
    median = np.median(sample.codes, axis=0)
    for fit in _significant([fit_outline_to_edges(edges, circle) for circle in circles]):
        outline = fit.outline
        rows, columns = outline.pixels_within(1.0, (median.shape[1], median.shape[0]))
        place = outline.scaled(1 / sample.scale)
        where = f"at {place.x:.0f}, {place.y:.0f} with radius {place.radius:.0f}"
        if np.mean(median[rows, columns] > _TUNABLES.white_code) > _TUNABLES.max_white:
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
