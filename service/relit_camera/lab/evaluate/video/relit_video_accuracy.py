"""Accuracy of a relit video against the ground-truth relit video of the same motion; reports as HTML, text, JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import VideoError
from relit_camera.base.images.color import luminance
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_types import DisplayImage, LinearImage
from relit_camera.base.images.tone_mapping import linear_from_display
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.lab.evaluate.field.relighting_metrics import finite_psnr
from relit_camera.lab.evaluate.report.html_page import Block, Heading, Paragraph, picture, render_page, table
from relit_camera.lab.evaluate.report.plots import line_plot
from relit_camera.lab.evaluate.video.head_motion_error import HeadMotion, PoseError, pose_error, second_difference_rms

SHADING_BLUR_SIGMA = 0.04
"""Sigma of the blur, as a fraction of the picture's width, after which light is compared and features hardly are."""
REPORT_FRAMES = 6
"""Approximate number of frames shown in the report."""
_NO_PERSON = (np.nan,) * 6
"""The figures of a frame without a person."""


@dataclass(frozen=True)
class LightConsistency:
    """Comparison of a relit video's light with the truth, by frame; PSNR inside the matte, in linear light.

    Frames with an empty matte have NaN.

    Attributes:
        psnr_db: (frames,) as it is.
        gain_aligned_db: (frames,) after one gain a frame: what is left is the light's distribution, and the features.
        shading_db: (frames,) the same, both pictures blurred within the matte: the light's distribution alone.
        gain_ev: (frames,) that gain in stops: how much too dark the relit frame is.
        brightness, true_brightness: (frames,) mean luminance inside the matte.
        shown: (index, relit, truth) of some frames.
    """

    psnr_db: NDArray[np.float64]
    gain_aligned_db: NDArray[np.float64]
    shading_db: NDArray[np.float64]
    gain_ev: NDArray[np.float64]
    brightness: NDArray[np.float64]
    true_brightness: NDArray[np.float64]
    shown: tuple[tuple[int, DisplayImage, DisplayImage], ...]

    @property
    def flicker(self) -> float:
        """RMS second difference of the brightness, as a fraction of its mean; NaN for under three frames."""
        return _flicker(self.brightness)

    @property
    def true_flicker(self) -> float:
        """RMS second difference of the truth's brightness, as a fraction of its mean: the part due to the motion."""
        return _flicker(self.true_brightness)


def compare_videos(
    relit: Path, truth: Path, matte: Path | None = None, progress: Callable[[int], None] = lambda done: None
) -> LightConsistency:
    """Compare two videos of the same frames, both shown through the project's display curve.

    Args:
        relit: the video to judge.
        truth: the ground-truth video.
        matte: a video whose pixels brighter than half are the person; without one the whole frame counts.
        progress: called with the frames done.

    Raises:
        VideoError: one cannot be read, they differ in size or length, or the matte is empty in every frame.
    """
    rows: list[tuple[float, ...]] = []
    shown: list[tuple[int, DisplayImage, DisplayImage]] = []
    paths = [relit, truth, matte] if matte else [relit, truth]
    with ExitStack() as files:
        readers = [files.enter_context(VideoReader(path)) for path in paths]
        every = max((readers[0].info.frames or 0) // REPORT_FRAMES, 1)
        names = ", ".join(f"{r.info.width}x{r.info.height}" for r in readers)
        if len({(reader.info.width, reader.info.height) for reader in readers}) > 1:
            raise VideoError(f"the videos to compare are {names}", "make them of one size")
        for index, frames in enumerate(zip_longest(*readers)):
            images = [frame.image for frame in frames if frame is not None]
            if len(images) < len(readers):
                raise VideoError(
                    f"{', '.join(path.name for path in paths)} differ in length after {index} frames",
                    "compare a whole replay with the truth of the same clip",
                )
            inside = images[2][..., 1] > 127 if matte else np.ones(images[0].shape[:2], bool)
            light = linear_from_display(images[0]), linear_from_display(images[1])
            rows.append(_frame_metrics(*light, inside) if inside.any() else _NO_PERSON)
            if index % every == every // 2:
                shown.append((index, images[0], images[1]))
            progress(index + 1)
    plain, aligned, shading, gain, brightness, true_brightness = np.array(rows).T
    if np.isnan(plain).all():
        raise VideoError(f"{matte} is empty in every frame", "white must mark the person")
    return LightConsistency(plain, aligned, shading, gain, brightness, true_brightness, tuple(shown))


def _frame_metrics(relit: LinearImage, truth: LinearImage, inside: NDArray[np.bool_]) -> tuple[float, ...]:
    """The six per-frame figures of `LightConsistency`, in its order."""
    mask = inside.astype(np.float32)
    seen, known = relit[inside], truth[inside]
    gain = _least_squares_gain(seen, known)
    soft_seen, soft_known = _blurred(relit, mask), _blurred(truth, mask)
    return (
        finite_psnr(relit, truth, mask),
        finite_psnr(relit * np.float32(gain), truth, mask),
        finite_psnr(
            soft_seen * np.float32(_least_squares_gain(soft_seen[inside], soft_known[inside])), soft_known, mask
        ),
        float(np.log2(max(gain, 1e-6))),
        float(luminance(seen).mean()),
        float(luminance(known).mean()),
    )


def _flicker(brightness: NDArray[np.float64]) -> float:
    return second_difference_rms(brightness) / max(float(np.nanmean(brightness)), 1e-12)


def _least_squares_gain(seen: NDArray[np.float32], known: NDArray[np.float32]) -> float:
    """The factor that brings `seen` nearest to `known` (least squares)."""
    return float((seen * known).sum(dtype=np.float64)) / max(float((seen * seen).sum(dtype=np.float64)), 1e-12)


def _blurred(picture: LinearImage, mask: NDArray[np.float32]) -> LinearImage:
    """Gaussian blur of a picture within a mask."""
    sigma = SHADING_BLUR_SIGMA * picture.shape[1]
    weight = cv2.GaussianBlur(mask, (0, 0), sigma)
    blurred = cv2.GaussianBlur(picture * mask[..., None], (0, 0), sigma)
    return np.asarray(blurred / np.maximum(weight, 1e-6)[..., None], np.float32)


ANGLES = ("yaw", "pitch", "roll")


@dataclass(frozen=True)
class VideoReport:
    """Result of a relit video's evaluation.

    Attributes:
        light: against the truth.
        pose: measured motion against the true one, where both were given.
        measured, truth: those motions.
    """

    light: LightConsistency
    measured: HeadMotion | None = None
    truth: HeadMotion | None = None

    @property
    def pose(self) -> PoseError | None:
        """The error of the measured pose.

        Raises:
            TrackError: the motions are not of the same video.
        """
        return pose_error(self.measured, self.truth) if self.measured and self.truth else None


def video_json(report: VideoReport) -> dict[str, object]:
    """The figures for JSON; None for what was not given, and for what too few frames cannot tell."""
    light, pose = report.light, report.pose
    return {
        "frames": len(light.psnr_db),
        "light": {
            "psnr_db": float(np.nanmean(light.psnr_db)),
            "gain_aligned_psnr_db": float(np.nanmean(light.gain_aligned_db)),
            "shading_psnr_db": float(np.nanmean(light.shading_db)),
            "gain_ev": float(np.nanmean(light.gain_ev)),
            "gain_ev_std": float(np.nanstd(light.gain_ev)),
        },
        "jitter": {
            "brightness_share": _none_if_nan(light.flicker),
            "true_brightness_share": _none_if_nan(light.true_flicker),
            "landmarks_px": _none_if_nan(_landmark_jitter(report.measured)),
            "true_landmarks_px": _none_if_nan(_landmark_jitter(report.truth)),
        },
        "pose": None
        if pose is None
        else {
            "frames": pose.frames,
            "angle_rms_deg": pose.angle_rms_deg,
            **{f"{name}_rms_deg": pose.rms_deg[i] for i, name in enumerate(ANGLES)},
            **{f"{name}_gain": _none_if_nan(pose.gain[i]) for i, name in enumerate(ANGLES)},
            **{f"{name}_offset_deg": pose.offset_deg[i] for i, name in enumerate(ANGLES)},
        },
    }


def video_text(report: VideoReport) -> str:
    """The most important figures as a few lines of text."""
    light, pose = report.light, report.pose
    plain, aligned, shading = map(np.nanmean, (light.psnr_db, light.gain_aligned_db, light.shading_db))
    lines = [
        f"{len(light.psnr_db)} frames",
        f"light: PSNR {plain:.2f} dB, gain aligned {aligned:.2f} dB, shading alone {shading:.2f} dB; "
        f"gain {np.nanmean(light.gain_ev):+.2f} EV, varying by {np.nanstd(light.gain_ev):.3f}",
        f"brightness jitter: {light.flicker:.3%} a frame, in truth {light.true_flicker:.3%}",
    ]
    if pose:
        angles = ", ".join(f"{name} {rms:.2f}" for name, rms in zip(ANGLES, pose.rms_deg, strict=True))
        lines.append(f"pose: {pose.angle_rms_deg:.2f} deg RMS ({angles}) over {pose.frames} frames")
    for name, motion in (("landmark jitter", report.measured), ("in truth", report.truth)):
        jitter = _landmark_jitter(motion)
        if jitter is not None:
            lines.append(f"{name}: {jitter:.3f} px a frame")
    return "\n".join(lines)


def video_page(report: VideoReport, title: str) -> str:
    """The HTML document."""
    parts = (_light, _jitter, _pose)
    return render_page(title, (block for part in parts for block in part(report)))


def _light(report: VideoReport) -> Iterator[Block]:
    light = report.light
    yield Paragraph(
        "The relit video is compared with the truth, the same motion rendered under the same light, frame by frame and "
        "inside the person's matte."
    )
    yield Heading("Light")
    indices, relit, truth = zip(*light.shown, strict=True)
    yield picture(
        contact_sheet([list(relit), list(truth)], ["relit", "truth"], [f"frame {i}" for i in indices], 160),
        "Some frames, relit above and in truth below. Shadows should fall on the same side and be as deep, and follow "
        "the head as it turns.",
        lossless=False,
    )
    rows = [
        ["as it is", np.nanmean(light.psnr_db), np.nanmin(light.psnr_db)],
        ["brightness aligned", np.nanmean(light.gain_aligned_db), np.nanmin(light.gain_aligned_db)],
        ["shading alone (blurred)", np.nanmean(light.shading_db), np.nanmin(light.shading_db)],
    ]
    yield table(
        ["PSNR, dB", "mean", "worst frame"],
        rows,
        f"Larger is better. Brightness aligned: one gain a frame, on average {np.nanmean(light.gain_ev):+.2f} stops. "
        "Shading alone: both pictures blurred, so that the position of facial features hardly counts.",
    )
    frames = np.arange(len(light.psnr_db))
    lines = {"as it is": light.psnr_db, "brightness aligned": light.gain_aligned_db, "shading alone": light.shading_db}
    yield line_plot(
        frames,
        lines,
        "frame",
        "PSNR, dB",
        "It falls where the head turns far: the source image shows no more of the sides than the camera saw.",
    )


def _jitter(report: VideoReport) -> Iterator[Block]:
    light = report.light
    yield Heading("Temporal stability")
    lines = {"truth": light.true_brightness, "relit": light.brightness}
    yield line_plot(
        np.arange(len(light.brightness)),
        lines,
        "frame",
        "mean luminance",
        "Brightness of the person. It should rise and fall as in truth, without flicker of its own. RMS second "
        f"difference from frame to frame: relit {light.flicker:.2%} of the mean, truth {light.true_flicker:.2%}.",
    )
    measured, known = _landmark_jitter(report.measured), _landmark_jitter(report.truth)
    if measured is not None:
        true_text = "" if known is None else f"; in truth {known:.3f} px"
        yield Paragraph(f"Landmark jitter: {measured:.3f} px (RMS of the second difference){true_text}.")


def _pose(report: VideoReport) -> Iterator[Block]:
    pose = report.pose
    if pose is None or report.measured is None or report.truth is None:
        return
    yield Heading("Head pose")
    yield table(
        ["angle", "RMS error, degrees", "gain", "offset, degrees"],
        [[name, pose.rms_deg[i], pose.gain[i], pose.offset_deg[i]] for i, name in enumerate(ANGLES)],
        f"Over {pose.frames} frames, after removing the constant offset, since the neutral pose is a convention. Gain: "
        "how far the measured angle moves when the true one moves by 1. Error of the whole rotation: "
        f"{pose.angle_rms_deg:.2f}° RMS.",
    )
    frames = np.arange(len(report.truth.angles_deg))
    for index, name in enumerate(ANGLES):
        lines: dict[str, NDArray[np.float64]] = {
            "truth": report.truth.angles_deg[:, index],
            "measured": report.measured.angles_deg[:, index] - pose.offset_deg[index],
        }
        yield line_plot(frames, lines, "frame", f"{name}, degrees", f"Measured {name}, its offset removed, and truth.")


def _landmark_jitter(motion: HeadMotion | None) -> float | None:
    """RMS second difference of landmark positions, pixels; None where there are no landmarks."""
    if motion is None or not motion.landmarks.shape[1]:
        return None
    return second_difference_rms(motion.landmarks) * float(np.sqrt(2))


def _none_if_nan(value: float | None) -> float | None:
    """For JSON, which has no NaN."""
    return None if value is None or np.isnan(value) else value
