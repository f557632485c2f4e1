"""What a picture may cost: the levels between which a busy computer chooses."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RenderQuality:
    """What a picture may cost.

    Attributes:
        relight_every: the source image is relit for every so many frames while the head turns, extrapolated between.
        half_size: mode portrait: whether the person is warped at half the output's size and enlarged.
        track_every: mode portrait: the face is tracked in every so many frames, followed by optical flow between.
        live_track_every: the same in mode live, where lips and lids are the live picture's own.
        matte_every: mode live before a kept room: the person is parted from it in so many frames, and in the others
            where they were.
        render_every: of so many frames that the source gives one is rendered, and shown until the next.
    """

    relight_every: int = 3
    half_size: bool = False
    track_every: int = 1
    live_track_every: int = 1
    matte_every: int = 1
    render_every: int = 1


FULL_QUALITY = RenderQuality()
"""Of a replay, which has time."""
QUALITY_LEVELS = (
    RenderQuality(live_track_every=2, matte_every=3),
    RenderQuality(relight_every=4, live_track_every=2, matte_every=3),
    RenderQuality(relight_every=4, half_size=True, live_track_every=2, matte_every=3),
    RenderQuality(relight_every=4, half_size=True, track_every=2, live_track_every=3, matte_every=3),
    RenderQuality(relight_every=4, half_size=True, track_every=2, live_track_every=3, matte_every=3, render_every=2),
)
"""Of the running camera, from full quality to the cheapest."""
