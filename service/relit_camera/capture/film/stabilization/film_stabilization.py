"""From a video whose dark frames are known to the transform of every frame (thesis 4.2.6, 4.3.3, and finer)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.capture.alignment.rigid_transform import RigidTransform, interpolate_transforms, transforms_to_array
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass
from relit_camera.capture.film.stabilization.face_crops import crop_faces
from relit_camera.capture.film.stabilization.refinement import align_bright, align_dark

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

_LEAST_FOLLOWED = 0.7
"""Share of the dark frames in which the face must be found."""
_HARDLY_FOLLOWED = 0.1
"""Share below which it has nothing to follow."""
_LEAST_BRIGHT = 8
_FAR_FLASHES = 1.5
"""Flashes to the nearest dark frame beyond which a frame's transform is not known."""


@dataclass(frozen=True, eq=False)
class Stabilization:
    """Where the face went.

    Attributes:
        transforms: for every frame of the video, from it to the reference.
        reference: index of the frame to which all are taken; its own transform is none.
        circle: of the face in the reference.
        measured: growing indices of the dark frames that were measured; between them it is interpolated.
        inliers: (measured,) corners of the face that agree on each one's transform.
        residual_px: (measured,) how far those are from where it has them (RMS).
        lost: indices of frames about which the face was not found.
        unsteady_px: how far frames are from where those before and after them would have them: the head's haste and the
            measurement's noise (RMS).
    """

    transforms: tuple[RigidTransform, ...]
    reference: int
    circle: FaceCircle
    measured: Indices
    inliers: Indices
    residual_px: Floats
    lost: frozenset[int]
    unsteady_px: float


def stabilize_film(
    path: Path,
    flashes: Flashes,
    circle: FaceCircle,
    *,
    finer: bool = True,
    threads: int = 1,
    progress: Callable[[int], None] = lambda frames: None,
) -> Stabilization:
    """Follow the face through a video, reading it once.

    Corners are followed from dark frame to dark frame; then each is aligned to the mean of all by its pixels, which is
    what a dark frame is predicted to look like. Bright frames lie between, by time; what is left in them is aligned to
    what the other bright frames predict, as far as the dark ones leave room for it.

    Args:
        path: the video.
        flashes: what its frames are.
        circle: of the face, as in `find_face_circle`.
        finer: without, corners and time alone tell, as in the thesis.
        threads: of the decoder.
        progress: called with the number of frames looked at.

    Raises:
        VideoError: the video cannot be read.
        CaptureError: the face has nothing to follow, or it goes away.
    """
    dark_frames, bright_frames, times_s = (
        flashes.indices(FrameClass.DARK),
        flashes.indices(FrameClass.BRIGHT),
        flashes.times_s,
    )
    views = crop_faces(path, dark_frames, bright_frames, circle, threads, progress)
    dark = views.of(dark_frames)
    transforms = dark.transforms
    if finer and transforms:
        transforms, unlike = align_dark(dark)
        dark, transforms = dark.only(~unlike), [each for each, bad in zip(transforms, unlike, strict=True) if not bad]
    lost = _lost(dark_frames, bright_frames, dark.index, times_s, flashes.schedule.frequency_hz)
    _require_followed_face(dark.index, dark_frames, lost, times_s)
    rows = transforms_to_array(transforms)
    reference = int(np.square(rows - np.median(rows, axis=0)).sum(axis=1).argmin())
    unsteady = _unsteadiness(dark.index, times_s, rows)
    every = interpolate_transforms(times_s, times_s[dark.index], transforms)
    bright = views.of(np.setdiff1d(bright_frames, list(lost)))
    if finer and len(bright.index) >= _LEAST_BRIGHT:
        flash = np.array([flashes.frames[index].flash for index in bright.index])
        by_time = [every[index] for index in bright.index]
        for index, aligned in zip(bright.index, align_bright(bright, by_time, flash, unsteady), strict=True):
            every[index] = aligned
    to_reference = transforms[reference].inverse()
    return Stabilization(
        transforms=tuple(each.then(to_reference).scaled(1 / views.scale) for each in every),
        reference=int(dark.index[reference]),
        circle=_moved(views.circle, to_reference, views.window.size).scaled(1 / views.scale),
        measured=dark.index,
        inliers=np.array([match.inliers for match in dark.matches], np.intp),
        residual_px=np.array([match.residual_px for match in dark.matches]) / views.scale,
        lost=lost,
        unsteady_px=float(np.hypot(*unsteady[1:])) / views.scale,
    )


def _unsteadiness(index: Indices, times_s: Floats, rows: Floats) -> Floats:
    """RMS (3,) of rotation and shift from what the dark frames between the flashes before and after would have them."""
    gap = np.cumsum(np.diff(index, prepend=index[0]) > 2)
    left = []
    for each in range(1, int(gap[-1])):
        here, there = gap == each, gap != each
        others = [np.interp(times_s[index[here]], times_s[index[there]], column[there]) for column in rows.T]
        left.append((rows[here] - np.stack(others, axis=1)).mean(axis=0))
    return np.sqrt(np.mean(np.square(left), axis=0)) if left else np.zeros(3)


def _lost(dark: Indices, bright: Indices, measured: Indices, times_s: Floats, frequency_hz: float) -> frozenset[int]:
    """Dark frames without a measurement, and bright ones too far from any."""
    lost = np.setdiff1d(dark, measured)
    if len(measured):
        away_s = np.abs(times_s[bright][:, None] - times_s[measured]).min(axis=1)
        bright = bright[away_s > _FAR_FLASHES / frequency_hz]
    return frozenset(lost.tolist()) | frozenset(bright.tolist())


def _require_followed_face(measured: Indices, dark: Indices, lost: frozenset[int], times_s: Floats) -> None:
    if len(measured) < max(2, _HARDLY_FOLLOWED * len(dark)):
        what = "the face shows nothing that can be followed in the dark frames"
        raise CaptureError(what, "make the room a little brighter, so that the face shows without the flash")
    if len(measured) < _LEAST_FOLLOWED * len(dark):
        first = float(times_s[min(lost)])
        followed = f"the face is found in {len(measured)} of {len(dark)} dark frames only"
        cure = "sit still, the head against something, until the end; keep hands off the face"
        raise CaptureError(f"{followed}; it is first lost at {first:.1f} s", cure)


def _moved(circle: FaceCircle, transform: RigidTransform, size: tuple[int, int]) -> FaceCircle:
    x, y = transform.apply(np.array([[circle.x, circle.y]]), size)[0]
    return FaceCircle(float(x), float(y), circle.radius)
