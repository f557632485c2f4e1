"""From a video of a person, a mirror ball and a blinking lamp to samples, unattended (thesis 4.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.capture.ball.outline import Outline
from relit_camera.capture.chain.findings import Findings
from relit_camera.capture.chain.merge import group_lights, merged, spread_evenly, thinned
from relit_camera.capture.chain.options import CaptureOptions, Progress, no_progress
from relit_camera.capture.chain.survey import survey
from relit_camera.capture.chain.usable import Lamps, find_lamps, refuse_one_sided
from relit_camera.capture.face_circle import Circle
from relit_camera.capture.light.head_square import HeadSquare, head_square
from relit_camera.capture.light.matte import flash_matte
from relit_camera.capture.light.near_field import to_distant
from relit_camera.capture.light.one_light import OneLight, read_one_light
from relit_camera.capture.light.strength import Strengths, find_strengths
from relit_camera.cores import workers
from relit_camera.errors import CaptureError, InputError
from relit_camera.reflectance.samples import Samples
from relit_camera.space.images import Mask

_MOST_FRAMES, _FEWEST_FRAMES = 600, 150
"""Bright frames that are kept in memory: a minute's, and fewer of larger pictures, but no fewer than these."""
_MEMORY_BYTES = 944_000_000
_PIXEL_BYTES = 6
"""Of a picture: three halves of a float."""
_SMALL = 96
"""Pixels a side of the pictures in which strengths and shape are found."""
_BALL_REACH = 1.15
"""Radii about a ball in which nobody is."""
_UNLIKE = 3.0
"""Frames whose light fits the person's shape so many times worse than usual are left out."""
_FAR = 1e3
"""Times as far as it was, a lamp is as good as infinitely far away."""
_LEAST_FACE = 0.5
"""Share of the face's circle that must be the person."""


@dataclass(frozen=True, eq=False)
class CaptureResult:
    """What a video gave.

    Attributes:
        samples: aligned pictures of the person under one distant light each.
        findings: on the way; the report is made of them.
    """

    samples: Samples
    findings: Findings


def build_samples(
    video: Path, options: CaptureOptions | None = None, progress: Progress = no_progress
) -> CaptureResult:
    """Samples of a capture video. It is read five times and never held in memory.

    Raises:
        VideoError: the video cannot be read, is cut off or damaged, or shows no face.
        CaptureError: something is missing in it; the message says what to do differently.
        InputError: an option is impossible.
    """
    options = options or CaptureOptions()
    _refuse_large(options.size)
    seen = survey(video, options, progress)
    found = find_lamps(seen, options)
    square = head_square(seen.motion.circle, seen.size, options.size)
    lamps = found.only(spread_evenly(found.directions, most_frames(square.size)))
    subtract = seen.gains.room_can_go if options.subtract_room is None else options.subtract_room
    total = len(seen.flashes.frames)
    lights = read_one_light(
        video,
        options.gamma,
        square,
        dict(enumerate(seen.motion.transforms)),
        dict(zip(seen.frames.tolist(), seen.gains.rgb, strict=True)),
        lamps.index,
        seen.dark,
        subtract=subtract,
        threads=options.threads,
        progress=lambda done: progress("Cutting out the flash's light", done, total),
    )
    progress("Finding the person", 0, None)
    matte = _matte(lights, square, [ball.found.outline for ball in seen.balls], seen.motion.circle)
    strengths, misfit_if_far = _strengths(lights, lamps, square, matte, seen.motion.circle)
    good = strengths.alike(_UNLIKE)
    refuse_one_sided(lamps.directions[good], len(seen.bright))
    groups = [thinned(good[group]) for group in group_lights(lamps.directions[good])]
    pictures = np.empty((len(groups), square.size, square.size, 3), np.float32)
    with workers() as pool:
        merging = pool.map(lambda group: _merged(lights, strengths, group, matte, options.near_field), groups)
        for place, picture in enumerate(merging):
            pictures[place] = picture
    directions = np.stack([lamps.directions[group].mean(axis=0) for group in groups])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    findings = Findings(
        video.name, options, seen, found, lamps.index, square, subtract, strengths, misfit_if_far, good, len(groups)
    )
    return CaptureResult(Samples(pictures, directions, matte), findings)


def most_frames(size: int) -> int:
    """How many bright frames are kept in memory as pictures with so many pixels a side."""
    return min(_MOST_FRAMES, _MEMORY_BYTES // (_PIXEL_BYTES * size**2))


def _refuse_large(size: int) -> None:
    if most_frames(size) < _FEWEST_FRAMES:
        most = math.isqrt(_MEMORY_BYTES // (_PIXEL_BYTES * _FEWEST_FRAMES))
        raise InputError(f"{size} pixels a side are more than memory holds", f"give a --size of {most} or less")


def _matte(lights: OneLight, square: HeadSquare, balls: Sequence[Outline], face: Circle) -> Mask:
    discs = [_disc(square, ball.x, ball.y, _BALL_REACH * ball.radius) for ball in balls]
    nobody = np.logical_or.reduce(discs)
    matte = flash_matte(lights.pictures, lights.room, nobody)
    share = matte[_disc(square, *face)].mean()
    if share < _LEAST_FACE:
        raise CaptureError(
            f"the flash lights {share:.0%} of the face: the person cannot be told from the room",
            "make the room darker, or hold the lamp nearer, about a metre from the face",
        )
    return matte


def _disc(square: HeadSquare, x: float, y: float, radius: float) -> NDArray[np.bool_]:
    """Pixels (size, size) of the square that are in a circle of the reference frame."""
    x, y = square.place(x, y)
    place = np.arange(square.size) + 0.5
    return np.asarray(np.hypot(place - x, place[:, None] - y) < radius * square.scale)


def _strengths(
    lights: OneLight, lamps: Lamps, square: HeadSquare, matte: Mask, face: Circle
) -> tuple[Strengths, float]:
    """The flashes' strengths, by small pictures; and how badly these would fit if the lamps were far away."""
    side = min(_SMALL, square.size)
    small = np.stack(
        [cv2.resize(each.astype(np.float32), (side, side), interpolation=cv2.INTER_AREA) for each in lights.pictures]
    )
    small, inside = np.maximum(small, 0), cv2.resize(matte, (side, side), interpolation=cv2.INTER_AREA)
    factor = side / square.size
    x, y = square.place(face.x, face.y)
    near, far = (
        find_strengths(
            small,
            lamps.lamps_cm * times,
            inside,
            (x * factor, y * factor),
            lamps.place.pixels_per_cm * square.scale * factor,
            measured=lamps.measured,
        )
        for times in (1.0, _FAR)
    )
    return near, far.usual_misfit


def _merged(
    lights: OneLight, strengths: Strengths, group: NDArray[np.intp], matte: Mask, near_field: bool
) -> NDArray[np.float32]:
    """One picture (size, size, 3) of a group's, each as under a distant flash of the usual strength; black outside."""
    surface = strengths.surface.resized((matte.shape[1], matte.shape[0]))
    pictures = []
    for each in group:
        factor = to_distant(surface, strengths.lamps[each]) if near_field else np.ones_like(matte)
        scale = (factor * (matte > 0) / np.float32(strengths.strength[each]))[..., None]
        pictures.append(lights.pictures[each].astype(np.float32) * scale)
    # A weak flash's picture, made as bright as others, has more noise.
    return np.maximum(merged(np.stack(pictures), strengths.strength[group] ** 2), 0)
