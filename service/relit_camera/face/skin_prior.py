"""What color skin has, before it is known in which light it is seen.

A picture gives the product of skin and light. Two rules part them. Both leave most of what is seen with the person, so
that nobody is made lighter or darker, redder or paler than their camera shows them:

- **Brightness.** A camera exposes the whole picture, so that its mean is a mid gray. Its exposure therefore tells how
  bright the room's light is in the picture, and skin that is darker in that light is darker skin. A part of the rest
  is left to the light, since exposure is no exact science (`light_share`). The whites of the eyes are nearly the same
  in all people: beside dark skin they are bright, beside light skin they are not.
- **Color.** A camera balances white. What its white is off by shows in skin: most of what is unexpected in the skin's
  color is the light's. Skin of all tones lies on one line, from light to dark. (The color of gray surroundings was
  tried as a second witness; before a sunset it misleads by more than it helps before a gray wall.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array
from relit_camera.base.images.color import LUMINANCE, luminance

LIGHTEST, DARKEST = np.array([0.56, 0.39, 0.315]), np.array([0.085, 0.046, 0.032])
"""Linear albedo of very light and very dark skin, a white wall having 1; all tones lie about the line between their
logarithms, as more or less melanin absorbs (Anderson and Parrish 1981)."""


@dataclass(frozen=True)
class SkinTunables:
    """How much of what is seen is taken for the skin's.

    Attributes:
        typical: luminance of a skin between the lightest and the darkest, in logarithms.
        light_share: share of an unexpected brightness that is taken for the light's.
        color_share: share of an unexpected color of the skin that is taken for the light's.
        facing_light: irradiance of a face, in a picture whose mean is `mid_gray`, in which a white wall would read it.
        mid_gray: to which cameras expose (the 18 % of photography).
        room_share: share of an unexpected exposure that changes what is taken for the face's light: the face and the
            room are not in the same light.
        room_range: logarithmic limits of that exposure.
        percentile: of the skin's luminances which counts: skin that the light reaches.
        like_eye_whites: luminance of skin that is seen as bright as the whites of its eyes, which the lids shade.
        like_lit_eye_whites: the same in light from the front, as of a screen, which shades them less.
        eye_slope: by how much darker skin is, in logarithms, whose eye whites are brighter than it. These numbers were
            found on rendered people from light to dark.
        eye_range: limits of that ratio.
        eye_share, lone_eye_share: weight of the eye whites beside the exposure, and where nothing is known of it.
    """

    typical: float = 0.2
    light_share: float = 0.2
    color_share: float = 0.8
    facing_light: float = 0.7
    mid_gray: float = 0.18
    room_share: float = 0.5
    room_range: tuple[float, float] = (-1.0, 1.0)
    percentile: float = 70.0
    like_eye_whites: float = 0.24
    like_lit_eye_whites: float = 0.32
    eye_slope: float = 1.25
    eye_range: tuple[float, float] = (0.5, 3.0)
    eye_share: float = 0.2
    lone_eye_share: float = 0.6


SKIN = SkinTunables()


def skin_of_luminance(value: float) -> Float64Array:
    """The albedo (3,) of skin of that luminance on the line from the lightest to the darkest; no further than these."""
    ends = np.log([float(LIGHTEST @ LUMINANCE), float(DARKEST @ LUMINANCE)])
    share = np.clip((np.log(max(value, 1e-6)) - ends[0]) / (ends[1] - ends[0]), 0, 1)
    color = np.exp((1 - share) * np.log(LIGHTEST) + share * np.log(DARKEST))
    # Luminance is no sum of logarithms: scaled to what was asked for, where that is within the ends.
    wanted = np.clip(value, np.exp(ends[1]), np.exp(ends[0]))
    return np.asarray(color * (wanted / float(color @ LUMINANCE)))


def estimate_skin(
    skin: NDArray[np.float32],
    frame_luminance: float | None,
    eye_whites: float | None = None,
) -> Float64Array:
    """The albedo (3,) of a person's skin.

    Args:
        skin: (count, 3) linear pixels of it.
        frame_luminance: mean linear luminance of the whole picture that the camera exposed, the room included; None
            where it is unknown.
        eye_whites: luminance of the whites of the eyes over that of skin, see `eye_white_ratio`; None where unknown.
    """
    brightness = luminance(skin)
    reached = brightness >= np.percentile(brightness, SKIN.percentile - 20)
    seen = np.median(skin[reached], axis=0).astype(np.float64)
    seen = np.maximum(seen, 1e-4)
    light = SKIN.facing_light
    if frame_luminance is not None:
        exposure = np.log(max(frame_luminance, 1e-4) / SKIN.mid_gray)
        light *= float(np.exp(SKIN.room_share * np.clip(exposure, *SKIN.room_range)))
    apparent = float(np.clip(float(seen @ LUMINANCE) / light, DARKEST @ LUMINANCE, LIGHTEST @ LUMINANCE))
    known = (1 - SKIN.light_share) * np.log(apparent) + SKIN.light_share * np.log(SKIN.typical)
    if eye_whites is not None:
        share = SKIN.eye_share if frame_luminance is not None else SKIN.lone_eye_share
        known = (1 - share) * known + share * _log_luminance_by_eyes(eye_whites, SKIN.like_eye_whites)
    expected = skin_of_luminance(float(np.exp(known)))
    level = float(expected @ LUMINANCE)
    own = seen / float(seen @ LUMINANCE)
    cast = SKIN.color_share * np.log(own / (expected / level))
    color = own / np.exp(cast)
    return np.asarray(color * (level / float(color @ LUMINANCE)))


def skin_luminance_by_eyes(eye_whites: float | None) -> float:
    """The luminance of skin in a picture that was exposed for the face itself, lit from the front.

    Such an exposure makes all skin equally bright, so the whites of the eyes alone tell it; typical skin, where these
    (see `eye_white_ratio`) are unknown.
    """
    if eye_whites is None:
        return SKIN.typical
    told = np.exp(_log_luminance_by_eyes(eye_whites, SKIN.like_lit_eye_whites))
    return float(np.clip(told, DARKEST @ LUMINANCE, LIGHTEST @ LUMINANCE))


def _log_luminance_by_eyes(eye_whites: float, like_eye_whites: float) -> float:
    return float(np.log(like_eye_whites) - SKIN.eye_slope * np.log(np.clip(eye_whites, *SKIN.eye_range)))
