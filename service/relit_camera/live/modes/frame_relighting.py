"""Relighting whole live frames by what the faces in them tell.

Each person is lit by their own face's ratio. Beyond them it goes on as that of whoever is near, and where nobody tells
their light the mean factor of a person takes its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import Box, DisplayImage, Frame
from relit_camera.base.images.light_multiplication import POWER, light_of_root, multiply_light, root_of_light
from relit_camera.base.images.temporal_noise import TemporalNoiseFilter
from relit_camera.live.modes.live_detail import live_cells, noise_fraction
from relit_camera.live.modes.ratio_relighting import FaceCells, FaceLight, RatioRelighting, cell_side

EXTRAPOLATION_CELLS, WIDE_REDUCTION = 45, 4
"""The extrapolation beyond the person is computed for so many there, and its wide blurs for fewer by a factor."""


CAST_KEPT, MOST_KEPT = 0.7, 0.25
"""Share of the room's color that what is no skin keeps, in logarithms, and the most of a channel: it is known by the
skin, whose own color is a guess, and on a grey sweater an error is seen as green. Skin differs no more than that."""
SKIN_HUE, REDDER = 0.25, 0.35
"""Distance of logarithms of colors from the face's within which a cell is skin as well, and what counts of it toward
red: ears are redder, and what is red is not seen to be off."""

HUE_REDUCTION = 2
"""What is skin is told for fewer cells, by a factor on each side."""
_LOGARITHMS = np.log(np.maximum(linear_from_uint8(np.arange(256, dtype=np.uint8)), np.float32(1e-3)))
"""Of the light of each code; darker ones than ten hardly tell a color."""


@dataclass(frozen=True)
class FacePlan:
    """How one face of a frame is relit.

    Attributes:
        relighting: of whom it is lit as.
        light: on the face.
        presence: how far the face tells its light, 0..1 and more than 0.
        is_seen: whether the frame shows it: a light goes on for a moment.
    """

    relighting: RatioRelighting
    light: FaceLight
    presence: float
    is_seen: bool = True


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
        person: (rows, columns) float32, how surely cells show what a source image has there of a person whose face
            is seen, 0..1; None where none is.
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
    """Relights one live frame after another. For one thread at a time.

    A plan of a face that is that of the last frame tells what it told there.
    """

    def __init__(self) -> None:
        """Begin without a frame."""
        self._noise = TemporalNoiseFilter()
        self._last: list[tuple[FacePlan, FaceCells]] = []

    def apply(self, plan: FramePlan, blend: float = 1.0) -> RelitCells:
        """The planned frame in the scene's light.

        `blend` is how far, in light: 0 gives the frame itself. Its brightest codes are taken for no more light than
        sRGB says the further it is relit: more is a guess, which the ratio would show as red blotches where skin is red
        first. Noise of the first person is removed over time in any case, where their face is followed.
        """
        image, step = plan.frame.image, cell_side(plan.frame.size)
        rows, columns = (-(-side // step) for side in image.shape[:2])
        factor = np.empty((rows, columns, 3), np.float32)
        factor[:] = root_of_light(plan.rest[None])[0]
        added, person = np.zeros_like(factor), None
        if plan.faces:
            whole = (0, 0, columns, rows) if blend < 1 else None
            if plan.first is not None:
                box = whole or plan.first.relighting.box(plan.first.light)
                image = self._noise.filtered(image, _pixels_of(box, step, plan.frame.size))
            known = {id(face): cells for face, cells in self._last if cells.box == (whole or cells.box)}
            self._last = [(face, known.get(id(face)) or _told_by(face, image, whole)) for face in plan.faces]
            told = [cells for _, cells in self._last]
            shares = [face.presence for face in plan.faces]
            factor, added = _combined(image, step, factor, told, shares, plan.first is not None)
            _keep_cast(factor, image, plan.faces, told)
            person = _sure_of(
                (rows, columns), [each for each, face in zip(told, plan.faces, strict=True) if face.is_seen]
            )
        if blend < 1:
            live, _ = live_cells(image, step, (0, 0, columns, rows))
            factor, added = blend_toward_live(factor, added, live, blend)
        return RelitCells(plan.frame.image, image, factor, added, 1 - blend, person)


def _told_by(face: FacePlan, image: DisplayImage, box: Box | None) -> FaceCells:
    """What a face tells of a box of cells, or where it tells anything."""
    return face.relighting.cells(image, face.light, box or face.relighting.box(face.light))


def _sure_of(shape: tuple[int, int], told: list[FaceCells]) -> NDArray[np.float32] | None:
    """How surely cells show a person, (rows, columns); None where nobody tells anything."""
    if not told:
        return None
    person = np.zeros(shape, np.float32)
    for cells in told:
        inside = _inside(cells.box)
        person[inside] = np.maximum(person[inside], cells.sure)
    return person


def _combined(
    image: DisplayImage,
    step: int,
    rest: NDArray[np.float32],
    told: list[FaceCells],
    shares: list[float],
    first_told: bool,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The factor of all cells, and what is added, (rows, columns, 3), by what faces tell.

    Args:
        image: the live picture.
        step: side of a cell in its pixels.
        rest: (rows, columns, 3) factor where nobody tells their light.
        told: by each face.
        shares: presence of each.
        first_told: whether the first of them is the face that the camera is for, of this very frame.
    """
    presence = max(shares)
    parts = [_scaled(cells, share / presence) for cells, share in zip(told, shares, strict=True)]
    known = np.zeros((*rest.shape[:2], 4), np.float32)
    for cells in parts:
        inside = _inside(cells.box)
        cv2.add(known[inside], cells.ratio, dst=known[inside])
    if len(parts) > 1:
        known /= np.maximum(known[..., 3:], 1)  # where two persons are side by side
    factor, added = extrapolate_roots(known), np.zeros_like(rest)
    for index, cells in enumerate(parts):
        inside = _inside(cells.box)
        trust = cv2.merge([cells.trust] * 3)
        more = cv2.multiply(cells.source.relit, 1 - trust)
        if index > 0:
            more += added[inside] * trust
        told_here = cv2.multiply(factor[inside], trust)
        if index == 0 and first_told:  # others are smaller, and told by a frame before this
            noise = noise_fraction(image, step, cells.box, np.asarray(told_here, np.float32), cells.source, cells.unit)
            calm = cv2.multiply(told_here, cv2.merge([noise] * 3))
            told_here = cv2.subtract(told_here, calm)
            more = cv2.add(more, cv2.multiply(calm, cells.smooth))
        factor[inside], added[inside] = told_here, more
    if presence < 1:
        factor = np.asarray(cv2.addWeighted(factor, presence, rest, 1 - presence, 0), np.float32)
        added *= np.float32(presence)
    return factor, added


def _scaled(cells: FaceCells, share: float) -> FaceCells:
    """What a face tells that is there by a share only."""
    if share >= 1:
        return cells
    part = np.float32(share)
    return replace(cells, ratio=cells.ratio * part, trust=1 - (1 - cells.trust) * part)


def _inside(box: Box) -> tuple[slice, slice]:
    left, top, right, bottom = box
    return np.s_[top:bottom, left:right]


def _keep_cast(
    factor: NDArray[np.float32], image: DisplayImage, faces: tuple[FacePlan, ...], told: list[FaceCells]
) -> None:
    """Give what is no skin back some of the color of the room's light, in roots of factors (rows, columns, 3)."""
    rows, columns = factor.shape[:2]
    small = (-(-columns // HUE_REDUCTION), -(-rows // HUE_REDUCTION))
    logarithms = cv2.split(cv2.LUT(cv2.resize(image, small, interpolation=cv2.INTER_LINEAR), _LOGARITHMS))
    hue = [cv2.subtract(logarithms[channel], logarithms[1]) for channel in (0, 2)]
    skin, nearby = np.zeros(small[::-1], np.float32), np.zeros((len(told), *small[::-1]), np.float32)
    for index, cells in enumerate(told):
        left, top, right, bottom = (side // HUE_REDUCTION for side in cells.box)
        inside = np.s_[top:bottom, left:right]
        if right <= left or bottom <= top:
            continue
        shown = cv2.multiply(cells.source.face, cells.source.confidence)
        on_face, skin_there, nearby[index][inside] = (
            cv2.resize(each, (right - left, bottom - top), interpolation=cv2.INTER_LINEAR)
            for each in (shown, cells.source.skin, cells.source.confidence)
        )
        skin[inside] = np.maximum(skin[inside], on_face * np.float32(faces[index].presence))
        seen = on_face * skin_there > 0.5
        if not seen.any():
            continue
        red, blue = (each - np.median(each[inside][seen]) for each in hue)
        red *= np.where(red > 0, np.float32(REDDER), 1)
        near = cv2.exp((red * red + blue * blue) * np.float32(-1 / SKIN_HUE**2))
        skin = np.maximum(skin, near * np.float32(faces[index].presence))
    casts = CAST_KEPT * np.log(np.maximum([face.light.cast for face in faces], 1e-3))
    presence = np.array([[face.presence] for face in faces], np.float32)
    more = presence * np.expm1(np.clip(casts, -MOST_KEPT, MOST_KEPT) / POWER).astype(np.float32)
    nearby *= presence[..., None]
    other = cv2.blur(1 - skin, (3, 3))[..., None] * (more[0] if len(told) == 1 else _by_whom(nearby, more))
    kept = cv2.resize(np.asarray(other, np.float32), (columns, rows), interpolation=cv2.INTER_LINEAR)
    cv2.add(kept, (1.0,) * 4, dst=kept)
    cv2.multiply(factor, kept, dst=factor)


def _by_whom(nearby: NDArray[np.float32], values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (persons, 3) of whoever is nearest, (rows, columns, 3), by where each is (persons, rows, columns)."""
    sigma = nearby.shape[2] / 12
    wide = np.stack([cv2.GaussianBlur(each, (0, 0), sigma) for each in nearby], axis=-1) + np.float32(1e-4)
    return np.asarray((wide / wide.sum(axis=-1, keepdims=True)) @ values, np.float32)


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
