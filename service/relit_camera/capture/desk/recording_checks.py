"""What can be wrong with a desk recording: each fault found is one clear line, an error or a warning."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.desk.desk_recording import DeskSetup
from relit_camera.capture.desk.patterns.pattern_sequence import undetermined_patches
from relit_camera.capture.desk.person.desk_face import DeskFace

DARK_CODE, CLIPPED_CODE = 40, 250
"""Codes of 255: the 90th percentile of a face must be above the one, few of its pixels may reach the other."""
MAX_CLIPPED = 0.05
MAX_GAIN_DRIFT, NOTED_GAIN_DRIFT = 0.25, 0.05
"""Change of the light under the same white: automatic exposure, or a screen that dims itself."""
NOTED_COLOR_DRIFT = 0.03
"""Change of its color: automatic white balance, or night light that sets in."""
NOTED_NONLINEARITY = 0.15
"""Difference of the sum of all patches from white: local dimming, HDR, a screen or webcam with a curve of its own."""
LIT = 0.2
"""Mean light of a frame, from the darkest to the brightest one, above which a face is looked for in it."""
MIN_LIKENESS = 0.3
"""Correlation of a face's details with those under white, below which it is not there. Faces lit from one side have 0.8
and more, by one lamp of forty 0.4 and more; a wall has less than 0.2."""
_DETAIL_BLURS, _DETAIL_SIDE = (0.02, 0.12), 160
"""Standard deviations of the two blurs between which details lie, in sides of the face; and that side in pixels."""
MAX_MOTION_CM, NOTED_MOTION_CM = 4.0, 0.8
_FOCAL_WIDTHS = 0.45, 2.2
"""Focal length of a webcam in widths of its picture, from very wide to narrow."""


def require_exposure(picture: DisplayImage, face: NDArray[np.bool_]) -> None:
    """Check a frame under a pattern that lights much of the screen.

    Raises:
        CaptureError: the face (height, width) in it is too dark, or over-exposed.
    """
    codes = picture[face].max(axis=1)
    bright = float(np.percentile(codes, 90))
    if bright < DARK_CODE:
        what = f"the face is too dark: its bright parts have codes of {bright:.0f} of 255"
        raise CaptureError(what, "raise the screen's brightness, come nearer, or clean the lens")
    clipped = float((codes >= CLIPPED_CODE).mean())
    if clipped > MAX_CLIPPED:
        what = f"the face is over-exposed: {clipped:.0%} of it is white"
        raise CaptureError(what, "lower the webcam's exposure or gain, or the screen's brightness")


def require_person(frames: Sequence[DisplayImage], levels: Float32Array, white: DisplayImage, face: DeskFace) -> None:
    """Check that the person whose face is in one frame is in all others.

    Args:
        frames: one under each pattern, in order of time; in dark ones nobody is looked for.
        levels: (frames,) mean light of each.
        white: the frame in which the face was found, as bright as may be.
        face: where it is.

    Raises:
        CaptureError: it is not.
    """
    radius = face.circle.radius
    wanted = _details(white, face, radius)
    lit = levels > levels.min() + LIT * np.ptp(levels)
    away = []
    for frame in (frame for frame, is_lit in zip(frames, lit, strict=True) if is_lit):
        around = _details(frame, face, radius + MAX_MOTION_CM * face.pixels_per_cm)
        away.append(float(cv2.matchTemplate(around, wanted, cv2.TM_CCOEFF_NORMED).max()) < MIN_LIKENESS)
    if any(away):
        what = f"you are not seen under {sum(away)} of {len(away)} patterns that light you"
        raise CaptureError(what, "film again, stay before the webcam until it is done, and nothing before your face")


def _details(picture: DisplayImage, face: DeskFace, reach_px: float) -> Float32Array:
    """Details of a frame within reach of the middle of the face."""
    x, y, half = round(face.circle.x), round(face.circle.y), max(round(reach_px), 1)
    region = picture[max(y - half, 0) : y + half, max(x - half, 0) : x + half]
    scale = _DETAIL_SIDE / (2 * face.circle.radius)
    small = cv2.resize(region, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    # In logarithms, so that what lies in shadow counts as much.
    gray = np.log(small.mean(axis=2, dtype=np.float32) + 16)
    fine, coarse = (cv2.GaussianBlur(gray, (0, 0), sigma * _DETAIL_SIDE) for sigma in _DETAIL_BLURS)
    return np.asarray(fine - coarse, np.float32)


def require_patterns(found: NDArray[np.intp], lights: Float64Array, frames: int) -> None:
    """Check that the patterns that were found (count,) suffice.

    Args:
        found: index in the sequence of each matched plateau.
        lights: (patterns, patches) of the sequence.
        frames: number of frames of the recording.

    Raises:
        CaptureError: they do not; patterns were missed, or the filming ended early.
    """
    undetermined = undetermined_patches(lights[np.unique(found)])
    if not undetermined:
        return
    last, count = int(found.max()) + 1, len(lights)
    seen = len(np.unique(found))
    if seen < last:
        what = f"frames are missing: only {seen} of the first {last} patterns were seen in {frames} frames"
    else:
        what = f"the recording ends early: {seen} of {count} patterns were seen in {frames} frames"
    raise CaptureError(
        what, "film again: stay before the webcam, leave the page open and the webcam free until it is done"
    )


def white_drift_warnings(whites: Sequence[Float32Array]) -> list[str]:
    """Warnings about means (3,) of the face under white, in order of time.

    Raises:
        CaptureError: they differ so much that the patterns cannot be compared.
    """
    if len(whites) < 2:
        return []
    first = whites[0]
    gains = [float(luminance(white) / max(float(luminance(first)), 1e-9)) for white in whites]
    worst = max(gains, key=lambda gain: abs(np.log(max(gain, 1e-3))))
    change = abs(worst - 1)
    if change > MAX_GAIN_DRIFT:
        what = f"the same white screen gave {worst:.2f} times the light later on"
        raise CaptureError(what, "hold the webcam's exposure, switch off automatic brightness, and keep still")
    warnings = []
    if change > NOTED_GAIN_DRIFT:
        warnings.append(f"the light under the same white changed by {change:.0%}: is the exposure automatic?")
    colors = [white / max(float(white.mean()), 1e-9) for white in whites]
    drift = max(float(np.abs(color / np.maximum(colors[0], 1e-6) - 1).max()) for color in colors)
    if drift > NOTED_COLOR_DRIFT:
        warnings.append(f"the color of the same white changed by {drift:.0%}: night light, or automatic white balance?")
    return warnings


def linearity_warnings(patches: Float32Array, whites: Sequence[Float32Array], room: Float32Array) -> list[str]:
    """Warnings about the sum of the patches' means (patches, 3), compared with those (3,) of white and of the room."""
    if not whites:
        return []
    added = float(luminance(np.mean(whites, axis=0)) - luminance(room))
    total = float(luminance(patches.sum(axis=0)))
    ratio = total / added if added > 0 else 1.0
    if abs(ratio - 1) <= NOTED_NONLINEARITY:
        return []
    return [
        f"all patches together give {ratio:.2f} times the light of white: local dimming, HDR, a dimming screen, or a "
        "webcam that changes contrast"
    ]


def motion_warnings(transforms: Sequence[RigidTransform], pixels_per_cm: float) -> list[str]:
    """Warnings about how far the head moved.

    Raises:
        CaptureError: so far that it was not the same pose.
    """
    moved = [float(np.hypot(each.x, each.y)) / pixels_per_cm for each in transforms]
    worst = max(moved, default=0.0)
    if worst > MAX_MOTION_CM:
        raise CaptureError(f"the head moved by {worst:.0f} cm", "lean on something, and keep still for the patterns")
    if worst > NOTED_MOTION_CM:
        return [f"the head moved by {worst:.1f} cm: keep stiller for a sharper result"]
    return []


def scale_warnings(face: DeskFace, setup: DeskSetup, width: int) -> list[str]:
    """Warnings about a distance that does not fit to how large the face is in frames of this width."""
    focal = face.pixels_per_cm * setup.distance_cm / width
    if _FOCAL_WIDTHS[0] <= focal <= _FOCAL_WIDTHS[1]:
        return []
    return [f"the face is as large as at another distance than {setup.distance_cm:.0f} cm: measure from eyes to screen"]
