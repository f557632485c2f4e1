"""Stabilization of a film: the transform of every frame to a reference frame of the face (thesis 4.2.6, 4.3.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import CaptureError
from relit_camera.capture.alignment.rigid_transform import RigidTransform, interpolate_transforms, transforms_to_array
from relit_camera.capture.film.face_circle import FaceCircle
from relit_camera.capture.film.flash.frame_classification import Flashes, FrameClass
from relit_camera.capture.film.stabilization.face_crops import crop_faces
from relit_camera.capture.film.stabilization.stabilization_refinement import align_bright, align_dark


@dataclass(frozen=True)
class StabilizationTunables:
    """What counts as tracked; `relit evaluate stabilisation` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        min_tracked: fraction of the dark frames in which the face must be found.
        min_features: fraction of the dark frames below which the face has no features to track.
        min_bright_frames: least bright frames for the refinement of their transforms.
        max_flash_periods: periods of the flash to the nearest measured dark frame beyond which the transform of a
            bright frame is unknown.
    """

    min_tracked: float = 0.7
    min_features: float = 0.1
    min_bright_frames: int = 8
    max_flash_periods: float = 1.5


_TUNABLES = StabilizationTunables()


@dataclass(frozen=True, eq=False)
class Stabilization:
    """The motion of the face through a film.

    Attributes:
        transforms: of every frame to the reference.
        reference: index of the reference frame, whose transform is the identity.
        circle: of the face in the reference.
        measured: growing indices of the dark frames in which motion was measured; between them it is interpolated.
        inliers: (measured,) number of corners that agree with each transform.
        residual_px: (measured,) root mean square distance of those from where the transform takes them.
        lost: indices of the bright and dark frames in which the face was not found.
        unsteady_px: root mean square distance of dark frames from the interpolation between others, by the head's
            motion and the measurement's noise.
    """

    transforms: tuple[RigidTransform, ...]
    reference: int
    circle: FaceCircle
    measured: Indices
    inliers: Indices
    residual_px: Float64Array
    lost: frozenset[int]
    unsteady_px: float


def stabilize_film(
    path: Path,
    flashes: Flashes,
    circle: FaceCircle,
    *,
    refine: bool = True,
    threads: int = 1,
    progress: Callable[[int], None] = lambda frames: None,
) -> Stabilization:
    """Measure the motion of the face, reading the film once.

    Corners are tracked from dark frame to dark frame; then each dark frame is aligned to the mean of all by its pixels.
    Transforms of bright frames are interpolated over time, and refined by aligning each to the picture that the other
    bright frames predict.

    Args:
        path: the film.
        flashes: of the film.
        circle: of the face in the film's pixels, to about a fifth of its radius.
        refine: whether transforms are refined by pixels; else corners alone are used, as in the thesis.
        threads: of the decoder.
        progress: called with the number of frames read.

    Raises:
        VideoError: the video cannot be read.
        CaptureError: the face has no features to track, or it leaves its place.
    """
    dark_frames, bright_frames, times_s = (
        flashes.indices(FrameClass.DARK),
        flashes.indices(FrameClass.BRIGHT),
        flashes.times_s,
    )
    crops = crop_faces(path, dark_frames, bright_frames, circle, threads, progress)
    dark = crops.of_frames(dark_frames)
    transforms = dark.transforms
    if refine and transforms:
        transforms, outliers = align_dark(dark)
        dark, transforms = (
            dark.subset(~outliers),
            [each for each, bad in zip(transforms, outliers, strict=True) if not bad],
        )
    lost = _lost_frames(dark_frames, bright_frames, dark.index, times_s, flashes.schedule.frequency_hz)
    _require_tracked_face(dark.index, dark_frames, lost, times_s)
    rows = transforms_to_array(transforms)
    reference = int(np.square(rows - np.median(rows, axis=0)).sum(axis=1).argmin())
    unsteady = _unsteadiness(dark.index, times_s, rows)
    every = interpolate_transforms(times_s, times_s[dark.index], transforms)
    bright = crops.of_frames(np.setdiff1d(bright_frames, list(lost)))
    if refine and len(bright.index) >= _TUNABLES.min_bright_frames:
        flash = np.array([flashes.frames[index].flash for index in bright.index])
        by_time = [every[index] for index in bright.index]
        for index, aligned in zip(bright.index, align_bright(bright, by_time, flash, unsteady), strict=True):
            every[index] = aligned
    to_reference = transforms[reference].inverse()
    return Stabilization(
        transforms=tuple(each.then(to_reference).scaled(1 / crops.scale) for each in every),
        reference=int(dark.index[reference]),
        circle=_moved(crops.circle, to_reference, crops.window.size).scaled(1 / crops.scale),
        measured=dark.index,
        inliers=np.array([match.inliers for match in dark.matches], np.intp),
        residual_px=np.array([match.residual_px for match in dark.matches]) / crops.scale,
        lost=lost,
        unsteady_px=float(np.hypot(*unsteady[1:])) / crops.scale,
    )


def _unsteadiness(index: Indices, times_s: Float64Array, rows: Float64Array) -> Float64Array:
    """Root mean square (3,) of rotation and shifts from the interpolation between the dark frames of other pauses."""
    pause = np.cumsum(np.diff(index, prepend=index[0]) > 2)
    deviations = []
    for each in range(1, int(pause[-1])):
        here, there = pause == each, pause != each
        others = [np.interp(times_s[index[here]], times_s[index[there]], column[there]) for column in rows.T]
        deviations.append((rows[here] - np.stack(others, axis=1)).mean(axis=0))
    return np.sqrt(np.mean(np.square(deviations), axis=0)) if deviations else np.zeros(3)


def _lost_frames(
    dark: Indices, bright: Indices, measured: Indices, times_s: Float64Array, frequency_hz: float
) -> frozenset[int]:
    """Dark frames without a measurement, and bright ones too far in time from any."""
    lost = np.setdiff1d(dark, measured)
    if len(measured):
        distance_s = np.abs(times_s[bright][:, None] - times_s[measured]).min(axis=1)
        bright = bright[distance_s > _TUNABLES.max_flash_periods / frequency_hz]
    return frozenset(lost.tolist()) | frozenset(bright.tolist())


def _require_tracked_face(measured: Indices, dark: Indices, lost: frozenset[int], times_s: Float64Array) -> None:
    """Check that the face was found in enough dark frames.

    Raises:
        CaptureError: it was not.
    """
    if len(measured) < max(2, _TUNABLES.min_features * len(dark)):
        what = "the face shows nothing that can be followed in the dark frames"
        raise CaptureError(what, "make the room a little brighter, so that the face shows without the flash")
    if len(measured) < _TUNABLES.min_tracked * len(dark):
        first = float(times_s[min(lost)])
        followed = f"the face is found in {len(measured)} of {len(dark)} dark frames only"
        cure = "sit still, the head against something, until the end; keep hands off the face"
        raise CaptureError(f"{followed}; it is first lost at {first:.1f} s", cure)


def _moved(circle: FaceCircle, transform: RigidTransform, size: tuple[int, int]) -> FaceCircle:
    """The circle after a transform about the center of a picture of this width and height."""
    x, y = transform.apply(np.array([[circle.x, circle.y]]), size)[0]
    return FaceCircle(float(x), float(y), circle.radius)
