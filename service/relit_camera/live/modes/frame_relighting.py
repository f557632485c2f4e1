"""Relighting whole live frames by what the faces in them tell.

Each person is lit by their own face's ratio. Beyond them it goes on as that of whoever is near, and where nobody tells
their light the mean factor of a person takes its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.images.light_multiplication import POWER, light_of_root, multiply_light, root_of_light
from relit_camera.base.images.temporal_noise import TemporalNoiseFilter
from relit_camera.live.modes.live_detail import live_cells, noise_fraction
from relit_camera.live.modes.ratio_relighting import FaceCells, FaceLight, RatioRelighting, cell_side
from relit_camera.live.reenactment.warp import Box

EXTRAPOLATION_CELLS, WIDE_REDUCTION = 45, 4
"""The extrapolation beyond the person is computed for so many there, and its wide blurs for fewer by a factor."""


CAST_KEPT, MOST_KEPT = 0.7, 0.25
"""Share of the room's color that what is no skin keeps, in logarithms, and the most of a channel: it is known by the
skin, whose own color is a guess, and on a grey sweater an error is seen as green. Skin differs no more than that."""
SKIN_HUE, REDDER = 0.25, 0.35
"""Distance of logarithms of colors from the face's within which a cell is skin as well, and what counts of it toward
red: ears are redder, and what is red is not seen to be off."""


@dataclass(frozen=True)
class FacePlan:
    """How one face of a frame is relit.

    Attributes:
        relighting: of whom it is lit as.
        light: on the face.
        presence: how far the face tells its light, 0..1 and more than 0.
    """

    relighting: RatioRelighting
    light: FaceLight
    presence: float


@dataclass(frozen=True)
class FramePlan:
    """What is known of one live frame before it is relit.

    Attributes:
        frame: the live frame.
        rest: (3,) float32 factor of light for people whose face does not tell their light.
        first: the face that the camera is for; None where it is not followed.
        others: the other faces.
    """

    frame: Frame
    rest: NDArray[np.float32]
    first: FacePlan | None = None
    others: tuple[FacePlan, ...] = ()

    @property
    def faces(self) -> tuple[FacePlan, ...]:
        """All that tell their light, the first one first."""
        return self.others if self.first is None else (self.first, *self.others)


@dataclass(frozen=True)
class RelitCells:
    """By what the light of each cell of a live frame is multiplied.

    Attributes:
        frame: the live frame, uint8 sRGB.
        calm: the same with less noise.
        factor: (rows, columns, 3) float32 roots of the factors of light.
        added: (rows, columns, 3) float32 roots that are added after that.
        as_shown: see `multiply_light`.
        person: (rows, columns) float32, how surely cells show what the first one's source image has there of them,
            0..1; None where they are not followed.
    """

    frame: DisplayImage
    calm: DisplayImage
    factor: NDArray[np.float32]
    added: NDArray[np.float32]
    as_shown: float
    person: NDArray[np.float32] | None

    def picture(self, within: Box | None = None) -> DisplayImage:
        """The frame in the other light, uint8 sRGB.

        Args:
            within: left, top, right and bottom of the pixels that are wanted; beyond them, but for less than two
                cells, the picture is as filmed. None for all.
        """
        height, width = self.frame.shape[:2]
        step = cell_side((width, height))
        if within is None:
            return multiply_light(self.calm, self.factor, step, self.as_shown, self.added)
        left, top = (max(start // step - 1, 0) for start in within[:2])
        right, bottom = (-(-end // step) + 1 for end in within[2:])
        pixels = np.s_[step * top : step * bottom, step * left : step * right]
        cells = np.s_[top:bottom, left:right]
        shown = self.frame.copy()
        shown[pixels] = multiply_light(self.calm[pixels], self.factor[cells], step, self.as_shown, self.added[cells])
        return shown


class FrameRelighting:
    """Relights one live frame after another. For one thread at a time."""

    def __init__(self) -> None:
        """Begin without a frame."""
        self._noise = TemporalNoiseFilter()

    def apply(self, plan: FramePlan, blend: float = 1.0) -> RelitCells:
        """The planned frame in the scene's light.

        `blend` is how far, in light: 0 gives the frame itself. Its brightest codes are taken for no more light than
        sRGB says the further it is relit: more is a guess, which the ratio would show as red blotches where skin is red
        first. Noise of the first person is removed over time in any case, where their face is followed.
        """
        image, step = plan.frame.image, cell_side(plan.frame.size)
        rows, columns = (-(-side // step) for side in image.shape[:2])
        rest = root_of_light(plan.rest[None])[0]
        factor = np.broadcast_to(rest, (rows, columns, 3)).astype(np.float32)
        added, person = np.zeros_like(factor), None
        if plan.faces:
            boxes = [face.relighting.box(face.light) if blend >= 1 else (0, 0, columns, rows) for face in plan.faces]
            if plan.first is not None:
                image = self._noise.filtered(image, _pixels_of(boxes[0], step, plan.frame.size))
            told = [face.relighting.cells(image, face.light, box) for face, box in zip(plan.faces, boxes, strict=True)]
            shares = [face.presence for face in plan.faces]
            factor, added = _combined(image, step, factor, told, shares)
            factor *= _cast_kept(image, step, plan.faces, told)
            if plan.first is not None:
                left, top, right, bottom = boxes[0]
                person = np.zeros((rows, columns), np.float32)
                person[top:bottom, left:right] = told[0].sure
        if blend < 1:
            live, _ = live_cells(image, step, (0, 0, columns, rows))
            factor, added = blend_toward_live(factor, added, live, blend)
        return RelitCells(plan.frame.image, image, factor, added, 1 - blend, person)


def _combined(
    image: DisplayImage, step: int, rest: NDArray[np.float32], told: list[FaceCells], shares: list[float]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The factor of all cells, and what is added, (rows, columns, 3), by what faces tell.

    Args:
        image: the live picture.
        step: side of a cell in its pixels.
        rest: (rows, columns, 3) factor where nobody tells their light.
        told: by each face.
        shares: presence of each.
    """
    presence = max(shares)
    known = np.zeros((*rest.shape[:2], 4), np.float32)
    for cells, share in zip(told, shares, strict=True):
        left, top, right, bottom = cells.box
        known[top:bottom, left:right] += cells.ratio * np.float32(share / presence)
    if len(told) > 1:
        known /= np.maximum(known[..., 3:], 1)  # where two persons are side by side
    factor, added = extrapolate_roots(known), np.zeros_like(rest)
    for cells, share in zip(told, shares, strict=True):
        left, top, right, bottom = cells.box
        inside = np.s_[top:bottom, left:right]
        trust = 1 - (1 - cells.trust) * np.float32(share / presence)
        trust = cv2.cvtColor(np.asarray(trust, np.float32), cv2.COLOR_GRAY2RGB)
        added[inside] *= trust
        added[inside] += cv2.multiply(cells.source.relit, 1 - trust)
        factor[inside] *= trust
        noise = noise_fraction(image, step, cells.box, factor[inside], cells.source, cells.unit)
        calm = cv2.multiply(factor[inside], cv2.cvtColor(noise, cv2.COLOR_GRAY2RGB))
        factor[inside] -= calm
        added[inside] += cv2.multiply(calm, cells.smooth)
    factor = np.asarray(cv2.addWeighted(factor, presence, rest, 1 - presence, 0), np.float32)
    return factor, np.asarray(added * np.float32(presence), np.float32)


def _cast_kept(
    image: DisplayImage, step: int, faces: tuple[FacePlan, ...], told: list[FaceCells]
) -> NDArray[np.float32]:
    """Roots of the color of the room's light that cells keep, (rows, columns, 3): 1 on skin."""
    rows, columns = (-(-side // step) for side in image.shape[:2])
    live, _ = live_cells(image, step, (0, 0, columns, rows))
    hue = _hue(live)
    skin = np.zeros((rows, columns), np.float32)
    for cells in told:
        left, top, right, bottom = cells.box
        inside = np.s_[top:bottom, left:right]
        on_face = cells.source.face * cells.source.confidence
        seen = on_face * cells.source.skin > 0.5
        if not seen.any():
            continue
        away = hue - np.median(hue[inside][seen], axis=0)
        away[..., 0] *= np.where(away[..., 0] > 0, np.float32(REDDER), 1)
        skin = np.maximum(skin, np.exp(-np.einsum("rci,rci->rc", away, away) / SKIN_HUE**2))
        skin[inside] = np.maximum(skin[inside], on_face)
    cast = CAST_KEPT * np.mean([np.log(np.maximum(face.light.cast, 1e-3)) for face in faces], axis=0)
    kept = np.clip(cast, -MOST_KEPT, MOST_KEPT) / POWER
    other = 1 - cv2.GaussianBlur(skin, (0, 0), 1.0)
    return np.asarray(np.exp(other[..., None] * kept), np.float32)


def _hue(roots: NDArray[np.float32]) -> NDArray[np.float32]:
    """Logarithms (rows, columns, 2) of red and blue light over green; roots are (rows, columns, 3)."""
    light = POWER * np.log(np.maximum(roots, np.float32(0.05)))
    return np.asarray(light[..., ::2] - light[..., 1:2], np.float32)


def _pixels_of(cells: Box, step: int, size: tuple[int, int]) -> Box:
    """The box of a frame's pixels, of `size` (width, height), that cells of `step` pixels show."""
    left, top, right, bottom = (step * side for side in cells)
    return left, top, min(right, size[0]), min(bottom, size[1])


def blend_toward_live(
    factor: NDArray[np.float32], added: NDArray[np.float32], live: NDArray[np.float32], share: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What a root x is multiplied by, and what is added to it, where a `share` in light of x · factor + added is shown.

    The rest is x itself. The mixture in light is not linear in x: it is so near `live`, the cells' own root, and
    everywhere where nothing is added. All are (rows, columns, 3).
    """
    live = np.maximum(live, np.float32(1e-3))
    relit = live * factor + added
    mixed = np.maximum(((1 - share) * live**POWER + share * relit**POWER) ** (1 / POWER), 1e-3)
    toward_live, toward_relit = (1 - share) * (live / mixed) ** (POWER - 1), share * (relit / mixed) ** (POWER - 1)
    return np.asarray(toward_live + toward_relit * factor, np.float32), np.asarray(toward_relit * added, np.float32)


def extrapolate_roots(warped: NDArray[np.float32]) -> NDArray[np.float32]:
    """Extrapolate a ratio that is known only on the person to the whole frame: its roots (height, width, 3) float32.

    Beyond the person it goes on smoothly: wide blurs of what is known, divided by the blurred weight, as light.

    Args:
        warped: (height, width, 4): roots of the ratio times weight, and the weight.
    """
    height, width = warped.shape[:2]
    small = _shrunk(warped, max(min(height, width) / EXTRAPOLATION_CELLS, 1))
    roots, weight = small[..., :3], small[..., 3:]
    small[..., :3] = light_of_root(roots / (weight + np.float32(1e-9))) * weight
    # Narrow blurs win where they have weight: detail near the person, the mean far away. Wide ones need fewer pixels.
    wide: NDArray = _sum_of_blurs(_shrunk(small, WIDE_REDUCTION), {2.0: 1 / 8**3, 5.0: 1 / 20**3})
    spread = cv2.add(
        _sum_of_blurs(small, {1.0: 1.0, 3.0: 1 / 3**3}),
        cv2.resize(wide, small.shape[1::-1], interpolation=cv2.INTER_LINEAR),
    )
    beyond = root_of_light((spread[..., :3] + np.float32(1e-9)) / (spread[..., 3:] + np.float32(1e-9)))
    beyond = cv2.resize(beyond, (width, height), interpolation=cv2.INTER_LINEAR)
    cover = cv2.cvtColor(cv2.extractChannel(warped, 3), cv2.COLOR_GRAY2RGB)
    known = cv2.cvtColor(warped, cv2.COLOR_RGBA2RGB)
    cv2.subtract(beyond, cv2.multiply(cover, beyond, dst=cover), dst=beyond)
    return np.asarray(cv2.add(known, beyond, dst=known), np.float32)


def _shrunk(picture: NDArray[np.float32], factor: float) -> NDArray[np.float32]:
    size = [max(int(side / factor), 1) for side in picture.shape[1::-1]]
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def _sum_of_blurs(picture: NDArray[np.float32], shares: Mapping[float, float]) -> NDArray[np.float32]:
    """A picture blurred by each of some sigmas, summed by their shares."""
    total = np.zeros_like(picture)
    for sigma, share in shares.items():
        blurred = cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
        total = cv2.scaleAdd(blurred, share, total, dst=total)
    return np.asarray(total, np.float32)
