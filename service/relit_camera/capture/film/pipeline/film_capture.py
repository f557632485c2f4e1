"""From a video of a person, a mirror ball and a blinking lamp to samples, unattended (thesis 4.3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError, InputError
from relit_camera.base.images.image_types import Mask
from relit_camera.base.threads import worker_pool
from relit_camera.capture.film.ball.sphere_projection import BallOutline
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.lamp.flash_matte import estimate_flash_matte
from relit_camera.capture.film.lamp.flash_strength import FlashStrengths, estimate_flash_strengths
from relit_camera.capture.film.lamp.head_crop import HeadCrop, place_head_crop
from relit_camera.capture.film.lamp.near_field import distant_light_factor
from relit_camera.capture.film.lamp.olat_pictures import OlatPictures, read_olat_pictures
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions, Progress, no_progress
from relit_camera.capture.film.pipeline.capture_report import Findings
from relit_camera.capture.film.pipeline.film_analysis import analyze_film
from relit_camera.capture.film.pipeline.lamp_localization import UsableLamps, find_usable_lamps, require_light_coverage
from relit_camera.capture.film.pipeline.light_clustering import (
    cluster_lights,
    merge_pictures,
    subsample_cluster,
    subsample_evenly,
)
from relit_camera.capture.reflectance.samples import Samples

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
    _require_size_in_memory(options.size)
    analysis = analyze_film(video, options, progress)
    found = find_usable_lamps(analysis, options)
    square = place_head_crop(analysis.motion.circle, analysis.size, options.size)
    lamps = found.only(subsample_evenly(found.directions, max_frames_in_memory(square.size)))
    subtract = analysis.gains.can_subtract_room if options.subtract_room is None else options.subtract_room
    total = len(analysis.flashes.frames)
    lights = read_olat_pictures(
        video,
        options.gamma,
        square,
        dict(enumerate(analysis.motion.transforms)),
        dict(zip(analysis.frames.tolist(), analysis.gains.rgb, strict=True)),
        lamps.index,
        analysis.dark,
        subtract=subtract,
        threads=options.threads,
        progress=lambda done: progress("Cutting out the flash's light", done, total),
    )
    progress("Finding the person", 0, None)
    matte = _matte(lights, square, [ball.found.outline for ball in analysis.balls], analysis.motion.circle)
    strengths, misfit_if_far = _strengths(lights, lamps, square, matte, analysis.motion.circle)
    good = strengths.consistent(_UNLIKE)
    require_light_coverage(lamps.directions[good], len(analysis.bright))
    groups = [subsample_cluster(good[group]) for group in cluster_lights(lamps.directions[good])]
    pictures = np.empty((len(groups), square.size, square.size, 3), np.float32)
    with worker_pool() as pool:
        merging = pool.map(lambda group: _merged(lights, strengths, group, matte, options.near_field), groups)
        for place, picture in enumerate(merging):
            pictures[place] = picture
    directions = np.stack([lamps.directions[group].mean(axis=0) for group in groups])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    findings = Findings(
        video.name, options, analysis, found, lamps.index, square, subtract, strengths, misfit_if_far, good, len(groups)
    )
    return CaptureResult(Samples(pictures, directions, matte), findings)


def max_frames_in_memory(size: int) -> int:
    """How many bright frames are kept in memory as pictures with so many pixels a side."""
    return min(_MOST_FRAMES, _MEMORY_BYTES // (_PIXEL_BYTES * size**2))


def _require_size_in_memory(size: int) -> None:
    if max_frames_in_memory(size) < _FEWEST_FRAMES:
        most = math.isqrt(_MEMORY_BYTES // (_PIXEL_BYTES * _FEWEST_FRAMES))
        raise InputError(f"{size} pixels a side are more than memory holds", f"give a --size of {most} or less")


def _matte(lights: OlatPictures, square: HeadCrop, balls: Sequence[BallOutline], face: FaceCircle) -> Mask:
    discs = [_disc(square, ball.x, ball.y, _BALL_REACH * ball.radius) for ball in balls]
    nobody = np.logical_or.reduce(discs)
    matte = estimate_flash_matte(lights.pictures, lights.room, nobody)
    share = matte[_disc(square, *face)].mean()
    if share < _LEAST_FACE:
        raise CaptureError(
            f"the flash lights {share:.0%} of the face: the person cannot be told from the room",
            "make the room darker, or hold the lamp nearer, about a metre from the face",
        )
    return matte


def _disc(square: HeadCrop, x: float, y: float, radius: float) -> NDArray[np.bool_]:
    """Pixels (size, size) of the square that are in a circle of the reference frame."""
    x, y = square.place(x, y)
    place = np.arange(square.size) + 0.5
    return np.asarray(np.hypot(place - x, place[:, None] - y) < radius * square.scale)


def _strengths(
    lights: OlatPictures, lamps: UsableLamps, square: HeadCrop, matte: Mask, face: FaceCircle
) -> tuple[FlashStrengths, float]:
    """The flashes' strengths, by small pictures; and how badly these would fit if the lamps were far away."""
    side = min(_SMALL, square.size)
    small = np.stack(
        [cv2.resize(each.astype(np.float32), (side, side), interpolation=cv2.INTER_AREA) for each in lights.pictures]
    )
    small, inside = np.maximum(small, 0), cv2.resize(matte, (side, side), interpolation=cv2.INTER_AREA)
    factor = side / square.size
    x, y = square.place(face.x, face.y)
    near, far = (
        estimate_flash_strengths(
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
    lights: OlatPictures, strengths: FlashStrengths, group: NDArray[np.intp], matte: Mask, near_field: bool
) -> NDArray[np.float32]:
    """One picture (size, size, 3) of a group's, each as under a distant flash of the usual strength; black outside."""
    surface = strengths.surface.resized((matte.shape[1], matte.shape[0]))
    pictures = []
    for each in group:
        factor = distant_light_factor(surface, strengths.lamps[each]) if near_field else np.ones_like(matte)
        scale = (factor * (matte > 0) / np.float32(strengths.strength[each]))[..., None]
        pictures.append(lights.pictures[each].astype(np.float32) * scale)
    # A weak flash's picture, made as bright as others, has more noise.
    return np.maximum(merge_pictures(np.stack(pictures), strengths.strength[group] ** 2), 0)
