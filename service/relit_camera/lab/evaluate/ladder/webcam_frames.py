"""Frames as a webcam takes them of a known person in a room."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_camera.base.images.tone_mapping import linear_from_display
from relit_camera.base.rotations import Rotation
from relit_camera.lab.evaluate.ladder.known_person import WHOLLY_THE_PERSON, KnownPerson
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.live.compositing.environment_view import EnvironmentView


@dataclass(frozen=True)
class WebcamModel:
    """What the simulated webcam is like.

    Attributes:
        side_px: of its frames, which are as wide as they are high; the known picture is enlarged to it.
        middle_gray: linear luminance to which exposure brings the mean of the frame's middle, person and room.
        middle_share: standard deviation of the weight that makes the middle, as a share of the side.
        clipped_percentile, clipped_at: exposure brings this percentile of the person no higher than this linear value.
        noise_codes: standard deviation, in codes of 255, of one frame's noise at middle gray.
        read_noise: linear light at which read noise has the variance of shot noise.
        height_deg: vertical field of view, by which the room is seen behind the person.
        room_blur: how much out of focus that room is (see `EnvironmentView`).
    """

    side_px: int = 480
    middle_gray: float = 0.18
    middle_share: float = 0.3
    clipped_percentile: float = 97.0
    clipped_at: float = 0.85
    noise_codes: float = 2.0
    read_noise: float = 0.05
    height_deg: float = 40.0
    room_blur: float = 0.15


WEBCAM = WebcamModel()
_MIDDLE_GRAY = 0.216
"""Linear light of code 128, where a unit of light has `_CODES_PER_LIGHT` codes."""
_CODES_PER_LIGHT = 274.0


@dataclass(frozen=True)
class RoomFrames:
    """The person before a webcam in a room.

    Attributes:
        room: the environment.
        frames: uint8 sRGB (side, side, 3); they differ by noise alone.
    """

    room: Environment
    frames: list[DisplayImage]


def film_in_room(person: KnownPerson, room: Environment, count: int, seed: int = 0) -> RoomFrames:
    """`count` frames of the person, who sits still, before the room that lights them."""
    size = (WEBCAM.side_px, WEBCAM.side_px)
    matte = np.clip(enlarged(person.samples.matte), 0, 1)[..., None]
    light = room.light_map * np.float32(auto_exposure_scale(room.light_map))
    view = EnvironmentView(room.panorama, size, WEBCAM.height_deg, WEBCAM.room_blur)
    behind = linear_from_display(view.picture(Rotation.identity(), auto_exposure_scale(room.light_map)))
    seen = enlarged(person.under(light)) + (1 - matte) * behind
    seen *= _exposure(seen, matte[..., 0] > WHOLLY_THE_PERSON)
    noise = np.random.default_rng(seed)
    return RoomFrames(room, [uint8_from_linear(_with_noise(seen, noise)) for _ in range(count)])


def _exposure(seen: LinearImage, person: NDArray[np.bool_]) -> np.float32:
    """The factor that automatic exposure finds for a picture (side, side, 3)."""
    place = (np.arange(WEBCAM.side_px) + 0.5) / WEBCAM.side_px - 0.5
    across = np.exp(-(place**2) / (2 * WEBCAM.middle_share**2))
    middle = float(np.average(luminance(seen), weights=np.outer(across, across)))
    bright = float(np.percentile(seen[person], WEBCAM.clipped_percentile))
    return np.float32(min(WEBCAM.middle_gray / max(middle, 1e-9), WEBCAM.clipped_at / max(bright, 1e-9)))


def enlarged(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """A picture or mask at the size of the webcam's frames, not negative."""
    size = (WEBCAM.side_px, WEBCAM.side_px)
    return np.maximum(np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_CUBIC), np.float32), 0)


def _with_noise(light: LinearImage, noise: np.random.Generator) -> LinearImage:
    """The light with shot and read noise, whose variance is a (l + r)."""
    scale = (WEBCAM.noise_codes / _CODES_PER_LIGHT) ** 2 / (_MIDDLE_GRAY + WEBCAM.read_noise)
    deviation = np.sqrt(scale * (np.maximum(light, 0) + WEBCAM.read_noise)).astype(np.float32)
    return light + deviation * noise.standard_normal(light.shape, np.float32)
