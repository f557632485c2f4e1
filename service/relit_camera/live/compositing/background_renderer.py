"""The background behind the person: a color, a picture, the environment, or the live room, blurred or as it is.

Where the webcam's picture stays private (mode portrait), there is no live room: `none` is then a dark neutral, and
`blur` blurs the environment that lights the face. Without an environment both, and `environment`, are the neutral.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.concurrency.resident_memory import large_allocations_apart
from relit_camera.base.config.look import (
    Background,
    BlurBackground,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Lighting,
    NoBackground,
)
from relit_camera.base.easing import ease_out_cubic
from relit_camera.base.images.color import linear_from_uint8, rgb_from_hex, srgb_encode, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.resize import crop_to_fill, halve
from relit_camera.base.images.tone_mapping import inverse_tone_curve, tone_curve
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.light.environments.environment_panorama import Environment, Panorama
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.scene_light import scene_light_map
from relit_camera.live.compositing.environment_view import BLUR_SIGMA, EnvironmentView
from relit_camera.live.compositing.matted_frame import MattedFrame

_WORKING_SIGMA = 1.5
"""The room is halved as long as the blur's sigma stays this many pixels."""

_MAX_REDUCTION = 8
"""Greatest factor: more shows when it is enlarged again."""

_HOLD_S = 0.05
"""For so long a blurred room is shown again where it is reduced by `_MAX_REDUCTION`: in every second frame of thirty a
second it is not made anew. What moves in it within that time moves by much less than it is blurred."""

_EPSILON = 1e-4


def blur_background(matted: MattedFrame, strength: float) -> DisplayImage:
    """Blur the live room without the person in linear light, sigma `strength` tenths of the height: uint8 sRGB.

    Normalised convolution: the person's pixels have no weight, so nothing of them bleeds into the room around them, and
    behind them the room is continued (Knutsson and Westin 1993).
    """
    height, width = matted.matte.shape
    return _enlarged(_blurred_room(matted, strength), (width, height))


def _reduction(height: int, strength: float) -> int:
    """The factor by which a room of that height is reduced before it is blurred."""
    reduction = 2
    while 2 * reduction <= min(BLUR_SIGMA * strength * height / _WORKING_SIGMA, _MAX_REDUCTION):
        reduction *= 2
    return reduction


def _enlarged(room: DisplayImage, size: tuple[int, int]) -> DisplayImage:
    """A blurred room at its whole size (width, height)."""
    enlarged: DisplayImage = cv2.resize(room, size, interpolation=cv2.INTER_LINEAR)
    return enlarged


def _blurred_room(matted: MattedFrame, strength: float) -> DisplayImage:
    """See `blur_background`; reduced by about `_reduction`."""
    height = len(matted.matte)
    sigma, reduction = BLUR_SIGMA * strength * height, _reduction(height, strength)
    # Averaged as light: of codes, small lamps would come out too dark. But four neighbours are so much alike that their
    # codes may be averaged first, which leaves a quarter of the look-ups. Only glints of a pixel suffer.
    steps, matte = cv2.LUT(matted.half.image, _light_in_16_bits()), matted.half.matte
    for _ in range(reduction.bit_length() - 2):
        steps, matte = halve(steps), halve(matte)
    light = steps * np.float32(1 / 65535)
    room = 1 - matte * np.float32(1 / 255)
    for _ in range(4):  # so high a power, 16, that a pixel counts only when it is all but surely room
        room = np.square(room)
    weighted = cv2.multiply(cv2.cvtColor(light, cv2.COLOR_RGB2RGBA), cv2.merge([room] * 4))
    # Deep behind the person, where no room is near, the constant brings in the room's mean.
    mean = np.array(cv2.mean(weighted))
    constant = _EPSILON * mean / max(mean[3], 1e-6)
    # Averaging r pixels to one and enlarging linearly blurs too, with a variance of r²/12 + r²/6.
    working_sigma = max((sigma / reduction) ** 2 - 1 / 4, 0.01) ** 0.5
    window = 2 * math.ceil(3 * working_sigma) + 1
    blurred = cv2.add(cv2.GaussianBlur(weighted, (window, window), working_sigma), (*constant[:3], _EPSILON))
    weights = cv2.cvtColor(cv2.extractChannel(blurred, 3), cv2.COLOR_GRAY2RGB)
    return uint8_from_linear(cv2.divide(cv2.cvtColor(blurred, cv2.COLOR_RGBA2RGB), weights))


@lru_cache(maxsize=1)
def _light_in_16_bits() -> NDArray[np.uint16]:
    """Linear light of each code, in steps of 1/65535."""
    return np.rint(linear_from_uint8(np.arange(256, dtype=np.uint8)) * 65535).astype(np.uint16)


_BAND_ROWS = 30
"""Rows of the dark neutral that are made at a time."""


_NEUTRAL_LIGHT = (0.030, 0.032, 0.036)
"""Linear light of the dark neutral where it is brightest, behind the head; a trace of blue lets skin look warm."""

_NEUTRAL_EDGE = 0.25
"""Its share of that light far from there."""


_VIEW_FIELDS = ("yaw_deg", "pitch_deg", "roll_deg", "exposure_ev", "saturation", "background_gain_ev")
"""Fields of the lighting that change how an environment looks."""


@dataclass(frozen=True, eq=False)
class BackgroundRequest:
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

    def same_image(self, other: BackgroundRequest) -> bool:
        """Whether both give the same picture without a live room: equal settings, identical sources."""
        if self.background != other.background or self.image is not other.image:
            return False
        if isinstance(self.background, EnvironmentBackground | BlurBackground):
            same = all(getattr(self.lighting, name) == getattr(other.lighting, name) for name in _VIEW_FIELDS)
            return same and self.environment is other.environment
        return self.lighting.background_gain_ev == other.lighting.background_gain_ev


@dataclass(frozen=True)
class _BlurredRoom:
    """A blurred room, reduced, how strongly it is blurred, and the time of the frame that shows it."""

    picture: DisplayImage
    strength: float
    time_s: float


class BackgroundRenderer:
    """Makes backgrounds of one size. One without live pixels is kept till it changes, and faded in. Not thread-safe."""

    def __init__(self, size: tuple[int, int]) -> None:
        """`size` is (width, height)."""
        self._size = size
        self._request: BackgroundRequest | None = None
        self._goal = self._shown = self._previous = np.empty((0, 0, 3), np.uint8)  # nothing is shown before a request
        self._changed_at = self._last = 0.0
        self._view: tuple[Panorama, float, float, EnvironmentView] | None = None
        self._room: _BlurredRoom | None = None

    def static_background(self, request: BackgroundRequest, now: float) -> DisplayImage:
        """The background at `now` seconds, without any live pixel; uint8 sRGB of the renderer's size.

        It is eased over the lighting's `transition_s` from the previous one, and must not be written to.

        Raises:
            ValueError: `request` has an `image` background and no image.
        """
        if self._request is None:
            self._goal = self._shown = self._previous = self._render(request)
        elif not request.same_image(self._request):
            # The change began after the last picture: this one shows its first step already.
            self._previous, self._goal, self._changed_at = self._shown, self._render(request), min(self._last, now)
        self._request, self._last = request, now
        share = ease_out_cubic(now - self._changed_at, request.lighting.transition_s)
        self._shown = crossfade(self._previous, self._goal, share)
        return self._shown

    def live_background(self, request: BackgroundRequest, matted: MattedFrame, now: float) -> DisplayImage:
        """The background of a live picture of the renderer's size: its room for `none` and `blur`, else a static one.

        Between the room and a static background there is a cut: no trace of the room stays where it shall not be seen.
        """
        match request.background:
            case NoBackground():
                image = matted.image
            case BlurBackground() as blur:
                image = self._blurred(matted, blur.strength, now)
            case _:
                self._room = None
                return self.static_background(request, now)
        self._request, self._view = None, None
        return apply_exposure(image, request.lighting.background_gain_ev)

    def _blurred(self, matted: MattedFrame, strength: float, now: float) -> DisplayImage:
        """`blur_background`, or that of the last frames again."""
        kept = self._room
        height = len(matted.matte)
        if kept is None or kept.strength != strength or not 0 < now - kept.time_s <= _HOLD_S:
            kept = _BlurredRoom(_blurred_room(matted, strength), strength, now)
            self._room = kept if _reduction(height, strength) == _MAX_REDUCTION else None
        return _enlarged(kept.picture, self._size)

    def _render(self, request: BackgroundRequest) -> DisplayImage:
        background, gain_ev = request.background, request.lighting.background_gain_ev
        if not isinstance(background, EnvironmentBackground | BlurBackground):
            self._view = None  # the panorama of a place that is shown no more may be large
        match background:
            case ColorBackground():
                return apply_exposure(solid_color(background.color, self._size), gain_ev)
            case ImageBackground():
                if request.image is None:
                    raise ValueError(f"the picture of the background '{background.image}' was not given")
                return apply_exposure(crop_to_fill(request.image, self._size), gain_ev)
            case EnvironmentBackground() if request.environment is not None:
                return self._environment(request.environment, request.lighting, background.height_deg, background.blur)
            case BlurBackground() if request.environment is not None:
                height_deg = EnvironmentBackground().height_deg
                return self._environment(request.environment, request.lighting, height_deg, background.strength)
        return apply_exposure(neutral_background(self._size), gain_ev)

    def _environment(
        self, environment: Environment, lighting: Lighting, height_deg: float, blur: float
    ) -> DisplayImage:
        panorama = environment.panorama
        if self._view is None or self._view[0] is not panorama or self._view[1:3] != (height_deg, blur):
            self._view = None  # else both would be in memory for a moment
            with large_allocations_apart(tidied=False):
                self._view = (panorama, height_deg, blur, EnvironmentView(panorama, self._size, height_deg, blur))
        rotation = rotation_from_angles(lighting.yaw_deg, lighting.pitch_deg, lighting.roll_deg)
        surround = scene_light_map(environment, lighting.model_copy(update={"lamps": ()}))
        gain_ev = lighting.exposure_ev + lighting.background_gain_ev
        return self._view[3].picture(rotation, auto_exposure_scale(surround) * 2**gain_ev)


@lru_cache(maxsize=2)
def neutral_background(size: tuple[int, int]) -> DisplayImage:
    """A dark neutral of `size` (width, height), lighter behind the head; dithered, since 8 bits would show as bands.

    It is made once, and must not be written to.
    """
    width, height = size
    x = (np.arange(width) + 0.5 - width / 2) / height
    y = (np.arange(height)[:, np.newaxis] + 0.5 - 0.45 * height) / height
    random = np.random.default_rng(0)
    neutral = np.empty((height, width, 3), np.uint8)
    for top in range(0, height, _BAND_ROWS):  # all of it at once would take 66 MB for a moment
        onto = neutral[top : top + _BAND_ROWS]
        falloff = np.exp(-(x**2 + y[top : top + _BAND_ROWS] ** 2) / (2 * 0.45**2))
        light = np.multiply.outer(_NEUTRAL_EDGE + (1 - _NEUTRAL_EDGE) * falloff, _NEUTRAL_LIGHT)
        onto[:] = np.floor(srgb_encode(light) * 255 + random.random((len(onto), width, 1)))
    return neutral


def solid_color(color: str, size: tuple[int, int]) -> DisplayImage:
    """One colour, `#rrggbb` in sRGB, over `size` (width, height)."""
    return np.full((size[1], size[0], 3), rgb_from_hex(color), dtype=np.uint8)


def apply_exposure(image: DisplayImage, gain_ev: float) -> DisplayImage:
    """The uint8 sRGB image with 2**gain_ev of its light: dimmed as it is, brightened through the display curve."""
    if gain_ev == 0:
        return image
    light, gain = linear_from_uint8(np.arange(256, dtype=np.uint8)), np.float32(2**gain_ev)
    changed = light * gain if gain < 1 else tone_curve(inverse_tone_curve(light) * gain)
    result: DisplayImage = cv2.LUT(image, uint8_from_linear(changed))
    return result


def crossfade(first: DisplayImage, second: DisplayImage, share: float) -> DisplayImage:
    """Mix two uint8 pictures of one size: a `share` of the second, the rest of the first."""
    if share >= 1 or first is second:
        return second
    mixed: DisplayImage = cv2.addWeighted(first, 1 - share, second, share, 0)
    return mixed
