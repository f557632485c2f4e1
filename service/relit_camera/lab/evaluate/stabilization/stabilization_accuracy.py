"""Accuracy of face stabilization in a rendered capture: baselines of thesis 4.2 and our method against the truth.

Reports are written as HTML, text and JSON.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float64Array, Indices
from relit_camera.base.errors import InputError, ModelError
from relit_camera.capture.alignment.rigid_transform import RigidTransform, interpolate_transforms, transforms_to_array
from relit_camera.capture.film.face_localization import locate_face
from relit_camera.capture.film.flash.flash_signal import measure_brightness
from relit_camera.capture.film.flash.frame_classification import FrameClass, detect_flashes
from relit_camera.capture.film.stabilization.film_stabilization import stabilize_film
from relit_camera.face.face_state import Tracker
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
from relit_camera.lab.evaluate.rendered_truth import HeadTruth, read_truth
from relit_camera.lab.evaluate.report.html_page import Block, Paragraph, render_page, table
from relit_camera.lab.evaluate.report.plots import line_plot
from relit_camera.lab.evaluate.stabilization.baseline_stabilizers import BASELINE_STABILIZERS, register_landmarks
from relit_camera.lab.evaluate.stabilization.face_crop_sequence import FaceCropSequence, read_face_crops

FramesUsed = Literal["bright", "dark", "both"]

NO_STABILIZATION, OUR_METHOD = "none", "ours"
_LANDMARKS = "landmarks"
_TRACKERS = ("mesh", "openseeface")


@dataclass(frozen=True, eq=False)
class StabilizationErrors:
    """Errors of one stabilizer: the head motion that its transforms leave in the bright frames.

    Attributes:
        method: its name.
        seen: the frames that it uses. Between dark ones the transforms are interpolated by time.
        rotation_deg: (bright,) found minus true, mean taken out: which frame is the reference does not matter.
        translation_px: (bright, 2) the same.
        lost: frames in which it found no face; they keep the last transform.
    """

    method: str
    seen: FramesUsed
    rotation_deg: Float64Array
    translation_px: Float64Array
    lost: int

    @property
    def distance_px(self) -> Float64Array:
        """Length (bright,) of the translation's error."""
        return np.asarray(np.linalg.norm(self.translation_px, axis=1))


@dataclass(frozen=True, eq=False)
class StabilizationReport:
    """Errors of all stabilizers on one video.

    Attributes:
        index: (bright,) of the frames that are compared.
        errors: of none, of the thesis's ways in its order, of ours.
        left_out: way → why it was not tried.
    """

    index: Indices
    errors: Sequence[StabilizationErrors]
    left_out: Mapping[str, str]


def compare_stabilization(
    video: Path, truth: Path, progress: Callable[[str, int], None] = lambda what, frames: None
) -> StabilizationReport:
    """Run every stabilizer, and compare the transforms of the bright frames with the truth.

    Args:
        video: a rendered capture.
        truth: its truth.json.
        progress: called with what is being done and the number of frames looked at.

    Raises:
        VideoError: the video cannot be read, or shows no face.
        CaptureError: there is no flash in it, or no face can be followed.
        InputError: the truth is missing, in another form, or of another video.
    """
    known = read_truth(truth, HeadTruth)
    seen = measure_brightness(video, progress=partial(progress, "Looking for flashes"))
    if len(seen.times_s) != len(known.frames):
        what = f"{video} has {len(seen.times_s)} frames, {truth} {len(known.frames)}"
        raise InputError(what, "both must be of the same video")
    flashes = detect_flashes(seen)
    circle = locate_face(seen, flashes).circle
    bright = flashes.indices(FrameClass.BRIGHT)
    rest = [known.frames[index].head.to_rest for index in bright]
    true_rows = np.array([[each.rotation_deg, *each.translation_px] for each in rest])
    tracker, left_out = _open_landmark_tracker()
    film = read_face_crops(video, flashes, circle, tracker, partial(progress, "Looking at the face"))
    errors = [_errors_against_truth(NO_STABILIZATION, "both", [RigidTransform()] * len(bright), true_rows, 0)]
    choices: tuple[tuple[FramesUsed, NDArray[np.bool_]], ...] = (("bright", film.bright), ("dark", ~film.bright))
    for method in [*BASELINE_STABILIZERS, *([_LANDMARKS] if tracker else [])]:
        for kind, chosen in choices:
            found = _stabilize_with(method, film, chosen, seen.size)
            times_s = flashes.times_s[film.index[chosen]]
            every = interpolate_transforms(flashes.times_s[bright], times_s, _fill_forward(found))
            errors.append(_errors_against_truth(method, kind, every, true_rows, found.count(None)))
    ours = stabilize_film(video, flashes, circle, progress=partial(progress, "Stabilizing"))
    every = [ours.transforms[index] for index in bright]
    errors.append(_errors_against_truth(OUR_METHOD, "both", every, true_rows, len(ours.lost)))
    return StabilizationReport(bright, errors, left_out)


def _stabilize_with(
    method: str, film: FaceCropSequence, chosen: NDArray[np.bool_], size: tuple[int, int]
) -> list[RigidTransform | None]:
    """Transforms, in the video's pixels, of the chosen frames of a film."""
    if method == _LANDMARKS:
        return register_landmarks([film.landmarks[index] for index in np.flatnonzero(chosen).tolist()], size)
    found = BASELINE_STABILIZERS[method](film.squares[chosen], film.circle_in_square)
    return [film.in_video(transform) for transform in found]


def _fill_forward(transforms: Sequence[RigidTransform | None]) -> list[RigidTransform]:
    """Transforms with missing ones replaced by the last known one, or by the identity at the beginning."""
    filled: list[RigidTransform] = []
    for transform in transforms:
        filled.append(transform or (filled[-1] if filled else RigidTransform()))
    return filled


def _errors_against_truth(
    method: str, seen: FramesUsed, found: Sequence[RigidTransform], true_rows: Float64Array, lost: int
) -> StabilizationErrors:
    left = transforms_to_array(found) - true_rows
    left -= left.mean(axis=0)
    return StabilizationErrors(method, seen, left[:, 0], left[:, 1:], lost)


def _open_landmark_tracker() -> tuple[Tracker | None, dict[str, str]]:
    """The best installed landmark tracker; or None, and the reason by method name."""
    why = ""
    for name in _TRACKERS:
        try:
            return open_tracker(name, TrackerOptions(blendshapes=False)), {}
        except ModelError as error:
            why = why or str(error)
    return None, {_LANDMARKS: why}


def stabilization_json(report: StabilizationReport) -> dict[str, object]:
    """The figures."""
    return {
        "bright_frames": len(report.index),
        "methods": [{"method": each.method, "seen": each.seen, **_figures(each)} for each in report.errors],
        "left_out": dict(report.left_out),
    }


def stabilization_text(report: StabilizationReport) -> str:
    """The figures as a table of plain text."""
    lines = [f"{'':32} {'px: RMS':>8} {'max':>7} {'deg: RMS':>9} {'max':>7} {'lost':>5}"]
    for each in report.errors:
        figures = _figures(each)
        lines.append(
            f"{_method_label(each):32} {figures['translation_rms_px']:8.3f} {figures['translation_max_px']:7.2f} "
            f"{figures['rotation_rms_deg']:9.3f} {figures['rotation_max_deg']:7.2f} {each.lost:5}"
        )
    return "\n".join([*lines, *(f"{name}: left out, {why}" for name, why in report.left_out.items())])


def stabilization_page(report: StabilizationReport, title: str) -> str:
    """The HTML document."""
    return render_page(title, _blocks(report))


def _blocks(report: StabilizationReport) -> Iterator[Block]:
    yield Paragraph(
        f"A capture was rendered, so that the head's motion is known. The errors are the motion that the transforms of "
        f"each method leave in its {len(report.index)} bright frames. Methods that use the bright frames see a "
        "different light in each; those that use the dark ones see one light, and interpolate by time. The thesis "
        "chooses sparse flow through the dark frames."
    )
    rows = [[_method_label(each), *_figures(each).values()] for each in report.errors]
    yield table(
        ["method", "translation RMS, px", "largest", "rotation RMS, degrees", "largest", "frames lost"],
        rows,
        "Smaller is better. The mean is removed, so that the choice of the reference frame does not matter.",
        digits=3,
        better="smaller",
    )
    for name, why in report.left_out.items():
        yield Paragraph(f"{name}: left out, {why}.")
    shown = [each for each in report.errors if each.method == OUR_METHOD or each.seen == "dark"]
    for label, values in (
        ("translation error, px", {_method_label(each): each.distance_px for each in shown}),
        ("rotation error, degrees", {_method_label(each): np.abs(each.rotation_deg) for each in shown}),
    ):
        yield line_plot(
            report.index,
            values,
            "frame",
            label,
            "Error that is left in each bright frame. Peaks are fast motion, which interpolation by time misses; a "
            "slope is drift.",
            from_zero=True,
        )


def _method_label(errors: StabilizationErrors) -> str:
    return errors.method if errors.seen == "both" else f"{errors.method}, {errors.seen} frames"


def _figures(errors: StabilizationErrors) -> dict[str, float]:
    distance, rotation = errors.distance_px, np.abs(errors.rotation_deg)
    return {
        "translation_rms_px": float(np.sqrt(np.mean(distance**2))),
        "translation_max_px": float(distance.max()),
        "rotation_rms_deg": float(np.sqrt(np.mean(rotation**2))),
        "rotation_max_deg": float(rotation.max()),
        "lost": errors.lost,
    }
