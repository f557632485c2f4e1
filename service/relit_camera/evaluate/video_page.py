"""A relit video's evaluation as a report for people, as text and as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.compose.sheet import contact_sheet
from relit_camera.evaluate.charts import line_chart
from relit_camera.evaluate.motion import Motion, PoseError, pose_error, second_difference_rms
from relit_camera.evaluate.page import chart, heading, page, paragraph, picture, table
from relit_camera.evaluate.video import LightConsistency

ANGLES = ("yaw", "pitch", "roll")


@dataclass(frozen=True)
class VideoReport:
    """What is known of a relit video.

    Attributes:
        light: against the truth.
        pose: measured motion against the true one, where both were given.
        measured, truth: those motions.
    """

    light: LightConsistency
    measured: Motion | None = None
    truth: Motion | None = None

    @property
    def pose(self) -> PoseError | None:
        """The error of the measured pose.

        Raises:
            TrackError: the motions are not of the same video.
        """
        return pose_error(self.measured, self.truth) if self.measured and self.truth else None


def video_json(report: VideoReport) -> dict[str, object]:
    """The figures; `null` for what was not given, and for what the frames are too few to tell."""
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
            "brightness_share": _known(light.flicker),
            "true_brightness_share": _known(light.true_flicker),
            "landmarks_px": _known(_landmark_jitter(report.measured)),
            "true_landmarks_px": _known(_landmark_jitter(report.truth)),
        },
        "pose": None
        if pose is None
        else {
            "frames": pose.frames,
            "angle_rms_deg": pose.angle_rms_deg,
            **{f"{name}_rms_deg": pose.rms_deg[i] for i, name in enumerate(ANGLES)},
            **{f"{name}_gain": _known(pose.gain[i]) for i, name in enumerate(ANGLES)},
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
    return page(title, (block for part in parts for block in part(report)))


def _light(report: VideoReport) -> Iterator[str]:
    light = report.light
    yield paragraph(
        "A video was relit, and the same motion was rendered under the same light: the truth. Frame by frame they are "
        "compared, inside the person's outline."
    )
    yield heading("Light")
    indices, relit, truth = zip(*light.shown, strict=True)
    yield picture(
        contact_sheet([list(relit), list(truth)], ["relit", "truth"], [f"frame {i}" for i in indices], 160),
        "Some frames, relit above and in truth below. Shadows should fall on the same side and be as deep, and follow "
        "the head as it turns.",
        exact=False,
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
        "Shading alone: both blurred, so that where features stand hardly counts.",
    )
    frames = np.arange(len(light.psnr_db))
    lines = {"as it is": light.psnr_db, "brightness aligned": light.gain_aligned_db, "shading alone": light.shading_db}
    yield chart(
        line_chart(frames, lines, "frame", "PSNR, dB"),
        "It falls where the head turns far: the captured still shows no more of the sides than the camera saw.",
    )


def _jitter(report: VideoReport) -> Iterator[str]:
    light = report.light
    yield heading("Steadiness")
    lines = {"truth": light.true_brightness, "relit": light.brightness}
    yield chart(
        line_chart(np.arange(len(light.brightness)), lines, "frame", "mean luminance"),
        "Brightness of the person. It should rise and fall as in truth, without a tremble of its own. Change of change "
        f"from frame to frame (RMS): relit {light.flicker:.2%} of the mean, truth {light.true_flicker:.2%}.",
    )
    measured, known = _landmark_jitter(report.measured), _landmark_jitter(report.truth)
    if measured is not None:
        true_text = "" if known is None else f"; in truth {known:.3f} px"
        yield paragraph(f"Landmarks tremble by {measured:.3f} px (RMS of their second difference){true_text}.")


def _pose(report: VideoReport) -> Iterator[str]:
    pose = report.pose
    if pose is None or report.measured is None or report.truth is None:
        return
    yield heading("Head pose")
    yield table(
        ["angle", "RMS error, degrees", "gain", "offset, degrees"],
        [[name, pose.rms_deg[i], pose.gain[i], pose.offset_deg[i]] for i, name in enumerate(ANGLES)],
        f"Over {pose.frames} frames, after taking out the offset, which is a matter of what is called neutral. Gain: "
        f"how far the measured angle moves when the true one moves by 1. The whole rotation is off by "
        f"{pose.angle_rms_deg:.2f}° RMS.",
    )
    frames = np.arange(len(report.truth.angles_deg))
    for index, name in enumerate(ANGLES):
        lines: dict[str, NDArray[np.float64]] = {
            "truth": report.truth.angles_deg[:, index],
            "measured": report.measured.angles_deg[:, index] - pose.offset_deg[index],
        }
        yield chart(line_chart(frames, lines, "frame", f"{name}, degrees"), f"Measured {name} over the true one.")


def _landmark_jitter(motion: Motion | None) -> float | None:
    """Of both coordinates together, pixels; None where there are no landmarks."""
    if motion is None or not motion.landmarks.shape[1]:
        return None
    return second_difference_rms(motion.landmarks) * float(np.sqrt(2))


def _known(value: float | None) -> float | None:
    """For JSON, which has no NaN."""
    return None if value is None or np.isnan(value) else value
