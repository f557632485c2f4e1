"""What stands behind the person.

Where the webcam's picture stays private (mode reenact), there is no live room: `none` is then a dark neutral, and
`blur` blurs the environment that lights the face. Without an environment both, and `environment`, are the neutral.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.compose.live_room import LiveRoom, blurred
from relit_camera.compose.view import EnvironmentView
from relit_camera.config.look import (
    Background,
    BlurBackground,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Lighting,
    NoBackground,
)
from relit_camera.light.environment import Environment
from relit_camera.light.exposure import display_scale
from relit_camera.light.panorama import Panorama
from relit_camera.light.room import room_light
from relit_camera.space.colour import linear_from_uint8, srgb_encode, uint8_from_linear
from relit_camera.space.display import display_curve, inverse_display_curve
from relit_camera.space.easing import eased_share
from relit_camera.space.images import DisplayImage
from relit_camera.space.rotation import rotation_from_angles

_NEUTRAL_LIGHT = (0.030, 0.032, 0.036)
"""Linear light of the dark neutral where it is brightest, behind the head; a trace of blue lets skin look warm."""

_NEUTRAL_EDGE = 0.25
"""Its share of that light far from there."""


_SEEN = ("yaw_deg", "pitch_deg", "roll_deg", "exposure_ev", "saturation", "background_gain_ev")
"""Fields of the lighting that change how an environment looks."""


@dataclass(frozen=True, eq=False)
class Wanted:
    """What a background is made from.

    Attributes:
        background: its settings.
        lighting: settings of the light: an environment is seen turned and exposed as it lights the face.
        environment: what lights the face, or None.
        image: uint8 sRGB picture of an `image` background, else None.
    """

    background: Background
    lighting: Lighting
    environment: Environment | None = None
    image: DisplayImage | None = None

    def same_still(self, other: Wanted) -> bool:
        """Whether both give the same picture without a live room: equal settings, identical sources."""
        if self.background != other.background or self.image is not other.image:
            return False
        if isinstance(self.background, EnvironmentBackground | BlurBackground):
            same = all(getattr(self.lighting, name) == getattr(other.lighting, name) for name in _SEEN)
            return same and self.environment is other.environment
        return self.lighting.background_gain_ev == other.lighting.background_gain_ev


def needs_room(background: Background, lighting: Lighting) -> bool:
    """Whether a live picture has to be parted into person and room: not while it is shown as it is."""
    return not isinstance(background, NoBackground) or lighting.background_gain_ev != 0


class Backdrop:
    """Makes backgrounds of one size. A still one is made once and kept; a change is faded in. Not thread-safe."""

    def __init__(self, size: tuple[int, int]) -> None:
        """`size` is (width, height)."""
        self._size = size
        self._wanted: Wanted | None = None
        self._goal = self._shown = self._before = neutral(size)
        self._changed_at = self._last = 0.0
        self._view: tuple[Panorama, float, float, EnvironmentView] | None = None

    def still(self, wanted: Wanted, now: float) -> DisplayImage:
        """The background at `now` seconds, without any live picture; uint8 sRGB of the backdrop's size.

        It is eased over the lighting's `transition_s` from the one before, and must not be written to.

        Raises:
            ValueError: `wanted` has an `image` background and no image.
        """
        if self._wanted is None:
            self._goal = self._shown = self._before = self._made(wanted)
        elif not wanted.same_still(self._wanted):
            # The change began after the last picture: this one shows its first step already.
            self._before, self._goal, self._changed_at = self._shown, self._made(wanted), min(self._last, now)
        self._wanted, self._last = wanted, now
        share = eased_share(now - self._changed_at, wanted.lighting.transition_s)
        self._shown = faded(self._before, self._goal, share)
        return self._shown

    def live(self, wanted: Wanted, room: LiveRoom, now: float) -> DisplayImage:
        """The background of a live picture of the backdrop's size: its room for `none` and `blur`, else as `still`.

        Between room and still there is a cut: no trace of the room stays where it shall not be seen.
        """
        match wanted.background:
            case NoBackground():
                image = room.image
            case BlurBackground() as blur:
                image = blurred(room, blur.strength)
            case _:
                return self.still(wanted, now)
        self._wanted = None
        return brightened(image, wanted.lighting.background_gain_ev)

    def _made(self, wanted: Wanted) -> DisplayImage:
        background, gain_ev = wanted.background, wanted.lighting.background_gain_ev
        match background:
            case ColorBackground():
                return brightened(plain(background.color, self._size), gain_ev)
            case ImageBackground():
                if wanted.image is None:
                    raise ValueError(f"the picture of the background '{background.image}' was not given")
                return brightened(cropped_to_fill(wanted.image, self._size), gain_ev)
            case EnvironmentBackground() if wanted.environment is not None:
                return self._environment(wanted.environment, wanted.lighting, background.height_deg, background.blur)
            case BlurBackground() if wanted.environment is not None:
                height_deg = EnvironmentBackground().height_deg
                return self._environment(wanted.environment, wanted.lighting, height_deg, background.strength)
        return brightened(neutral(self._size), gain_ev)

    def _environment(
        self, environment: Environment, lighting: Lighting, height_deg: float, blur: float
    ) -> DisplayImage:
        panorama = environment.panorama
        if self._view is None or self._view[0] is not panorama or self._view[1:3] != (height_deg, blur):
            self._view = (panorama, height_deg, blur, EnvironmentView(panorama, self._size, height_deg, blur))
        rotation = rotation_from_angles(lighting.yaw_deg, lighting.pitch_deg, lighting.roll_deg)
        surround = room_light(environment, lighting.model_copy(update={"lamps": ()}))
        gain_ev = lighting.exposure_ev + lighting.background_gain_ev
        return self._view[3].picture(rotation, display_scale(surround) * 2**gain_ev)


@lru_cache(maxsize=2)
def neutral(size: tuple[int, int]) -> DisplayImage:
    """A dark neutral of `size` (width, height), lighter behind the head; dithered, since 8 bits would show as bands.

    It is made once, and must not be written to.
    """
    width, height = size
    x = (np.arange(width) + 0.5 - width / 2) / height
    y = (np.arange(height)[:, np.newaxis] + 0.5 - 0.45 * height) / height
    falloff = np.exp(-(x**2 + y**2) / (2 * 0.45**2))
    light = np.multiply.outer(_NEUTRAL_EDGE + (1 - _NEUTRAL_EDGE) * falloff, _NEUTRAL_LIGHT)
    noise = np.random.default_rng(0).random((height, width, 1))
    return np.floor(srgb_encode(light) * 255 + noise).astype(np.uint8)


def plain(color: str, size: tuple[int, int]) -> DisplayImage:
    """One colour, `#rrggbb` in sRGB, over `size` (width, height)."""
    return np.full((size[1], size[0], 3), list(bytes.fromhex(color[1:])), dtype=np.uint8)


def cropped_to_fill(image: DisplayImage, size: tuple[int, int]) -> DisplayImage:
    """The image scaled to cover `size` (width, height), and its middle cut out."""
    return cover(image, size, cv2.INTER_CUBIC)


def cover(picture: NDArray[np.uint8], size: tuple[int, int], enlarging: int) -> NDArray[np.uint8]:
    """`cropped_to_fill` for any uint8 picture (height, width, ...), enlarged with that interpolation of OpenCV's."""
    height, width = picture.shape[:2]
    scale = max(size[0] / width, size[1] / height)
    columns, rows = min(width, round(size[0] / scale)), min(height, round(size[1] / scale))
    left, top = (width - columns) // 2, (height - rows) // 2
    cut = np.ascontiguousarray(picture[top : top + rows, left : left + columns])
    filled: NDArray[np.uint8] = cv2.resize(cut, size, interpolation=cv2.INTER_AREA if scale < 1 else enlarging)
    return filled


def brightened(image: DisplayImage, gain_ev: float) -> DisplayImage:
    """The uint8 sRGB image with 2**gain_ev of its light: dimmed as it is, brightened through the display curve."""
    if gain_ev == 0:
        return image
    light, gain = linear_from_uint8(np.arange(256, dtype=np.uint8)), np.float32(2**gain_ev)
    changed = light * gain if gain < 1 else display_curve(inverse_display_curve(light) * gain)
    result: DisplayImage = cv2.LUT(image, uint8_from_linear(changed))
    return result


def faded(before: DisplayImage, after: DisplayImage, share: float) -> DisplayImage:
    """Between two pictures: `share` of `after`."""
    if share >= 1 or before is after:
        return after
    mixed: DisplayImage = cv2.addWeighted(before, 1 - share, after, share, 0)
    return mixed
