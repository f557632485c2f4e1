"""The pictures of the patterns: each plateau's frames, averaged in linear light, cropped and aligned to each other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.capture.alignment.rigid_transform import (
    RigidTransform,
    transforms_from_array,
    transforms_to_array,
)
from relit_camera.capture.alignment.template_alignment import (
    align_across_lights,
    align_to_mean,
    gaussian_blur,
    without_border,
)
from relit_camera.capture.desk.desk_recording import DeskRecording, require_frame
from relit_camera.capture.desk.patterns.plateaus import Plateau, decode_table
from relit_camera.capture.film.olat.head_crop import HeadCrop

ROUNDS = 3
"""Of alignment."""
HUE_FLOOR = 0.02
"""Summand of red and green in the pictures' bright values: in the dark hue is noise."""
HUE_BLUR_PX = 0.7
MIN_HUE_CONTRAST = 0.02
"""Standard deviation of hue on the face, below which the webcam shows no color and shading must serve."""
STILL_PX = 0.05
"""Largest motion of a face that has kept still: nothing is gained by moving it."""
MIN_LIGHT = 0.25
"""Mean light of a picture relative to that under white, below which it is not aligned: a black screen shows nothing."""
MARGIN_PX = 24
"""About the crop, over which a head may move."""
_SETTLING_FRAMES = 1
"""At either end of a plateau left out where it is long enough: a screen's last change may still be under way."""


def mean_frame(recording: DeskRecording, plateau: Plateau) -> LinearImage:
    """Mean linear light (height, width, 3) of a plateau's frames."""
    table = decode_table(recording.setup.camera_gamma)
    frames = settled_frames(plateau)
    total = np.zeros((*recording.size[::-1], 3), np.float32)
    for index in frames:
        total += cv2.LUT(require_frame(recording, index), table)
    return total / np.float32(len(frames))


def settled_frames(plateau: Plateau) -> range:
    """Indices of the frames of a plateau without those at its ends, where enough remain."""
    trim = _SETTLING_FRAMES if plateau.stop - plateau.start >= 6 * _SETTLING_FRAMES else 0
    return range(plateau.start + trim, plateau.stop - trim)


@dataclass(frozen=True, eq=False)
class PatternFrames:
    """The part of each plateau's mean frame about the head, in the webcam's own pixels.

    Attributes:
        frames: (plateaus, height, width, 3) linear.
        crop: the square in it that becomes the subject's picture.
    """

    frames: Float32Array
    crop: HeadCrop

    def cropped(self, transforms: Sequence[RigidTransform] | None = None) -> Float32Array:
        """The squares (plateaus, size, size, 3), moved by transforms of theirs about their middle.

        Frames are resampled once only: each time blurs them, and by where between pixels the head was.
        """
        still = [RigidTransform()] * len(self.frames)
        moves = still if transforms is None else [each.scaled(1 / self.crop.scale) for each in transforms]
        return np.stack([self.crop.crop(frame, move) for frame, move in zip(self.frames, moves, strict=True)])


def pattern_frames(
    recording: DeskRecording,
    plateaus: Sequence[Plateau],
    crop: HeadCrop,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> PatternFrames:
    """The mean frame of each plateau about the crop of the head."""
    width, height = crop.picture
    left, top = max(int(crop.left) - MARGIN_PX, 0), max(int(crop.top) - MARGIN_PX, 0)
    right, bottom = (
        min(int(first + crop.side) + 1 + MARGIN_PX, length)
        for first, length in ((crop.left, width), (crop.top, height))
    )
    frames = np.empty((len(plateaus), bottom - top, right - left, 3), np.float32)
    for index, plateau in enumerate(plateaus):
        frames[index] = mean_frame(recording, plateau)[top:bottom, left:right]
        progress(index + 1, len(plateaus))
    inside = replace(crop, left=crop.left - left, top=crop.top - top, picture=(right - left, bottom - top))
    return PatternFrames(frames, inside)


def _hues(pictures: Float32Array, weights: Mask) -> Float32Array:
    """Logarithm of red over green (count, height, width), which does not depend on where white light comes from.

    Aligned by shading, a face that is lit from the left seems to have moved; lips, brows, eyes and hair have not.
    """
    bright = float(np.percentile(pictures[:, weights > 0], 90))
    floor = np.float32(HUE_FLOOR * bright)
    light = np.maximum(pictures, 0) + floor
    return np.stack([gaussian_blur(each, HUE_BLUR_PX) for each in np.log(light[..., 0] / light[..., 1])])


def find_motion(pictures: Float32Array, light: NDArray[np.floating], weights: Mask) -> list[RigidTransform]:
    """The transforms about the pictures' middle that take each to their mean position.

    Args:
        pictures: (count, height, width, 3) linear.
        light: (count,) mean light of each relative to white.
        weights: (height, width) weight of each pixel, 0 on the background.
    """
    lit = np.flatnonzero(light >= MIN_LIGHT)
    inside = without_border(weights)
    hues = _hues(pictures[lit], inside)
    if min(float(hue[inside > 0].std()) for hue in hues) > MIN_HUE_CONTRAST:
        found, _ = align_to_mean(list(hues), inside, [RigidTransform()] * len(lit), ROUNDS)
    else:
        found = align_across_lights(luminance(pictures[lit]), weights, rounds=ROUNDS)
    rows = transforms_to_array(found)
    rows -= rows.mean(axis=0)
    if np.hypot(rows[:, 1], rows[:, 2]).max() < STILL_PX:
        return [RigidTransform()] * len(pictures)
    # A dark picture lies between its neighbors in time.
    moves = np.stack([np.interp(np.arange(len(pictures)), lit, column) for column in rows.T], axis=1)
    return transforms_from_array(moves)
