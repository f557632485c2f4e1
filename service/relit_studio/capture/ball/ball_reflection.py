"""Reflections in the mirror ball: the ray-traced room, and the torch as a small, very bright disc.

Balls and person do not see each other: neither their mirror images of one another nor shadows between them are made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.light.directions import map_position_from_direction
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.ball.mirror_ball import MirrorBall
from relit_studio.capture.flash.torch import RADIUS_CM, Torch
from relit_studio.mannequin.rendering.shading import axes_along

_SUPERSAMPLING = 4
_DISC_SAMPLES = 64
"""Rays along each side of the window around the torch's reflection."""
_SHARP_PX, _GLARE_PX = 0.6, 5.0
_GLARE = 0.02
"""Point spread of the lens: sigmas of a narrow and a wide Gaussian, and the fraction of light in the wide one."""
_PANORAMA_ROWS = 256
"""Rows of the panorama that the ball reflects; it shrinks the room, so finer detail would alias."""


@dataclass(frozen=True, eq=False)
class Room:
    """Light of the room from all directions.

    Attributes:
        radiance: float32 (h, 2h, 3), linear RGB in map axes, scaled to this capture's ambient light.
    """

    radiance: NDArray[np.float32]

    def seen_along(self, directions: NDArray[np.float64]) -> NDArray[np.float32]:
        """Radiance (h, w, 3) along unit vectors (h, w, 3), in units of a white wall under unit irradiance."""
        rows, columns = self.radiance.shape[:2]
        row, column = map_position_from_direction(directions, rows, columns)
        wrapped = np.concatenate([self.radiance[:, -1:], self.radiance, self.radiance[:, :1]], axis=1)
        picked = cv2.remap(
            wrapped,
            (column + 1).astype(np.float32),
            row.astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        # Radiance L reads π·L in the unit of a white wall, which sends out 1 / π of its irradiance.
        return np.asarray(np.pi * picked, np.float32)

    def coarse(self) -> Room:
        """The room reduced to the resolution that the ball can show."""
        rows = min(_PANORAMA_ROWS, self.radiance.shape[0])
        return Room(np.asarray(cv2.resize(self.radiance, (2 * rows, rows), interpolation=cv2.INTER_AREA)))


def room_in_ball(ball: MirrorBall, camera: Pinhole, room: Room) -> tuple[LinearImage, Mask]:
    """Reflection of the room (height, width, 3), premultiplied, and coverage of the ball (height, width)."""
    image = np.zeros((camera.height, camera.width, 3), np.float32)
    coverage = np.zeros((camera.height, camera.width), np.float32)
    left, top, right, bottom = _box(ball, camera)
    fine = _SUPERSAMPLING
    x, y = np.meshgrid(
        left + (np.arange((right - left) * fine) + 0.5) / fine, top + (np.arange((bottom - top) * fine) + 0.5) / fine
    )
    hit, _, mirrored = ball.reflect(camera.rays(x, y).reshape(-1, 3))
    directions = np.full((hit.size, 3), [0.0, 0.0, 1.0])
    directions[hit] = mirrored
    seen = room.coarse().seen_along(directions.reshape(*x.shape, 3)) * ball.reflectance
    coverage_fine = hit.reshape(x.shape).astype(np.float32)
    fine_image = np.concatenate([seen * coverage_fine[..., None], coverage_fine[..., None]], axis=2)
    averaged = cv2.resize(fine_image, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
    image[top:bottom, left:right] = averaged[..., :3]
    coverage[top:bottom, left:right] = averaged[..., 3]
    return image, coverage


def room_in_balls(balls: Sequence[MirrorBall], camera: Pinhole, room: Room) -> tuple[LinearImage, Mask]:
    """Reflection of the room and coverage, as `room_in_ball`, of several balls that do not occlude each other."""
    images, coverages = zip(*(room_in_ball(ball, camera, room) for ball in balls), strict=True)
    return np.sum(images, axis=0), np.sum(coverages, axis=0)


def torch_in_ball(ball: MirrorBall, camera: Pinhole, torch: Torch) -> LinearImage:
    """Reflection of the torch (height, width, 3), spread by the lens; black if the torch does not face the ball.

    Rays through a window about the image are mirrored and cut with the disc, which gives the energy that reaches the
    lens; every ray's fraction is spread over pixels by the point spread function.
    """
    image = np.zeros((camera.height, camera.width, 3), np.float32)
    x, y, area = _disc_window(ball, camera, torch)
    light = _disc_light(ball, camera, torch, x.ravel(), y.ravel())
    seen = light > 0
    if not seen.any():
        return image
    energy = light[seen] * area
    for fraction, sigma in ((1 - _GLARE, _SHARP_PX), (_GLARE, _GLARE_PX)):
        columns, across = _spread(x.ravel()[seen], sigma, camera.width)
        rows, down = _spread(y.ravel()[seen], sigma, camera.height)
        spread = fraction * (down * energy[:, None]).T @ across
        image[rows, columns] += spread[..., None].astype(np.float32) * ball.reflectance
    return image


def highlight_px(ball: MirrorBall, camera: Pinhole, torch: Torch) -> tuple[float, float]:
    """Position, in pixels, of the torch's reflection in the ball."""
    x, y = _mirrored(ball, camera, torch.position)
    return float(x), float(y)


def _mirrored(ball: MirrorBall, camera: Pinhole, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position (2,), in pixels, of the reflection of a point (3,) in the ball."""
    return np.asarray(camera.project(ball.reflection_point(point)[None])[0, :2])


def _box(ball: MirrorBall, camera: Pinhole) -> tuple[int, int, int, int]:
    outline = ball.outline(camera)
    reach = outline.semi_radial + 2
    left, right = (int(np.clip(outline.x + side * reach, 0, camera.width)) for side in (-1, 1))
    top, bottom = (int(np.clip(outline.y + side * reach, 0, camera.height)) for side in (-1, 1))
    return left, top, right, bottom


def _disc_window(
    ball: MirrorBall, camera: Pinhole, torch: Torch
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Sample positions (n, n), (n, n) about the disc's image, and the area of each in pixels."""
    right, down, _ = axes_along(torch.aim)
    middle = _mirrored(ball, camera, torch.position)
    rim = [torch.position + RADIUS_CM * (c * right + s * down) for c, s in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    reach = 1.6 * max(float(np.linalg.norm(_mirrored(ball, camera, point) - middle)) for point in rim)
    step = 2 * reach / _DISC_SAMPLES
    steps = -reach + step * (np.arange(_DISC_SAMPLES) + 0.5)
    x, y = np.meshgrid(middle[0] + steps, middle[1] + steps)
    return x, y, step * step


def _disc_light(
    ball: MirrorBall, camera: Pinhole, torch: Torch, x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Radiance of the disc reflected at positions (count,) by a perfect mirror."""
    hit, points, mirrored = ball.reflect(camera.rays(x, y))
    # The disc emits to its front only.
    facing = -(mirrored @ torch.aim)
    travel = ((torch.position - points) @ torch.aim) / np.where(facing > 1e-9, -facing, np.inf)
    offset = points + travel[:, None] * mirrored - torch.position
    on_disc = (facing > 1e-9) & (travel > 0) & (np.square(offset).sum(axis=1) <= RADIUS_CM**2)
    light = np.zeros(len(x))
    light[np.flatnonzero(hit)[on_disc]] = np.pi * torch.radiance(facing[on_disc])
    return light


def _spread(place: NDArray[np.float64], sigma: float, size: int) -> tuple[slice, NDArray[np.float64]]:
    """The pixels of a line of `size` about places (count,) in it, and each place's fraction (count, pixels) in them.

    A Gaussian of `sigma`, exact within each pixel; what lies beyond 6 sigma is left out.
    """
    low, high = (int(np.clip(end, 0, size)) for end in (place.min() - 6 * sigma, place.max() + 6 * sigma + 1))
    edges = np.arange(low, high + 1)
    return slice(low, high), np.diff(ndtr((edges - place[:, None]) / sigma), axis=1)
