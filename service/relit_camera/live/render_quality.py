"""What a picture may cost: the levels between which a busy computer chooses."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RenderQuality:
    """What a picture may cost.

    Attributes:
        relight_every: the source image is relit for every so many frames while the head turns, extrapolated between.
        half_size: mode reenact: whether the person is warped at half the output's size and enlarged.
        track_every: the face is tracked in every so many frames, followed by optical flow between.
        render_every: of so many frames that the source gives one is rendered, and shown until the next.
    """

    relight_every: int = 3
    half_size: bool = False
    track_every: int = 1
    render_every: int = 1


QUALITY_LEVELS = (
    RenderQuality(),
    RenderQuality(relight_every=4),
    RenderQuality(relight_every=4, half_size=True),
    RenderQuality(relight_every=4, half_size=True, track_every=2),
    RenderQuality(relight_every=4, half_size=True, track_every=2, render_every=2),
)
"""From full quality to the cheapest."""
FULL_QUALITY = QUALITY_LEVELS[0]
