"""Head motion in a video, read from a track, a replay's report or a truth.json, and its error."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial.transform import Rotation

from relit_camera.base.errors import TrackError
from relit_camera.lab.evaluate.json_records import Record, read_json_record


class _Angles(Record):
    yaw: float
    pitch: float
    roll: float = 0.0


class _Frame(Record):
    found: bool = True
    pose: _Angles | None = None
    pose_deg: _Angles | None = None
    landmarks: tuple[tuple[float, float], ...] = ()


class _MotionFile(Record):
    frames: list[_Frame] = Field(min_length=1)


@dataclass(frozen=True)
class HeadMotion:
    """A head's motion.

    Attributes:
        angles_deg: (frames, 3) yaw, pitch and roll; NaN where there was no face.
        landmarks: (frames, count, 2) pixels; NaN where there was no face; count is 0 where the file has none.
    """

    angles_deg: NDArray[np.float64]
    landmarks: NDArray[np.float64]


@dataclass(frozen=True)
class PoseError:
    """Error of a measured head pose, without the constant offset, since the neutral pose is a convention.

    Attributes:
        frames: that both have.
        rms_deg: of yaw, pitch and roll.
        gain: slope of the measured angle over the true one; NaN where the true one hardly moves (under 1°).
        offset_deg: mean of measured minus true.
        angle_rms_deg: of the whole rotation, its mean taken out.
    """

    frames: int
    rms_deg: tuple[float, float, float]
    gain: tuple[float, float, float]
    offset_deg: tuple[float, float, float]
    angle_rms_deg: float


def read_head_motion(path: Path) -> HeadMotion:
    """Read `frames[].pose` (or `pose_deg`) `{yaw, pitch, roll}` in degrees, and `landmarks` where there are some.

    Frames that say `found: false` have neither.

    Raises:
        TrackError: missing, no JSON, without frames, or with a varying number of landmarks.
    """
    cure = "give a track, a replay's report, or a truth.json, whose frames have a pose"
    document = read_json_record(path, _MotionFile, cure, TrackError)
    # A truth.json has poses for frames in which the face is not visible, too.
    frames = [frame if frame.found else _Frame() for frame in document.frames]
    poses = [frame.pose or frame.pose_deg for frame in frames]
    angles = [(pose.yaw, pose.pitch, pose.roll) if pose else (np.nan,) * 3 for pose in poses]
    counts = {len(frame.landmarks) for frame in frames if frame.landmarks}
    if len(counts) > 1:
        raise TrackError(f"{path} has frames of {min(counts)} and of {max(counts)} landmarks", "track the video again")
    count = counts.pop() if counts else 0
    points = [frame.landmarks or [(np.nan, np.nan)] * count for frame in frames]
    return HeadMotion(np.array(angles, float), np.array(points, float).reshape(len(points), count, 2))


def pose_error(measured: HeadMotion, truth: HeadMotion) -> PoseError:
    """Compare two motions frame by frame.

    Raises:
        TrackError: they differ in length, or have fewer than two frames with a pose in common.
    """
    if len(measured.angles_deg) != len(truth.angles_deg):
        lengths = f"{len(measured.angles_deg)} and {len(truth.angles_deg)} frames"
        raise TrackError(f"the motions to compare have {lengths}", "both must be of the same video")
    both = np.isfinite(measured.angles_deg).all(axis=1) & np.isfinite(truth.angles_deg).all(axis=1)
    if both.sum() < 2:
        raise TrackError("the motions have fewer than two frames with a face in common", "track another video")
    seen, known = measured.angles_deg[both], truth.angles_deg[both]
    difference = seen - known
    moved, expected = seen - seen.mean(axis=0), known - known.mean(axis=0)
    spread = (expected**2).mean(axis=0)
    slope = (moved * expected).mean(axis=0) / np.where(spread > 1, spread, np.nan)
    turns = Rotation.from_euler("YXZ", seen, degrees=True) * Rotation.from_euler("YXZ", known, degrees=True).inv()
    residual = np.degrees((turns * turns.mean().inv()).magnitude())
    rms = np.sqrt(((difference - difference.mean(axis=0)) ** 2).mean(axis=0))
    return PoseError(
        frames=int(both.sum()),
        rms_deg=_as_angles(rms),
        gain=_as_angles(slope),
        offset_deg=_as_angles(difference.mean(axis=0)),
        angle_rms_deg=float(np.sqrt((residual**2).mean())),
    )


def second_difference_rms(values: NDArray[np.float64]) -> float:
    """RMS over frames of x[t+1] − 2 x[t] + x[t−1] of values (frames, ...), NaN left out; NaN for under three frames.

    It is zero for uniform motion, small for acceleration and large for jitter.
    """
    second = np.diff(values, 2, axis=0)
    known = second[np.isfinite(second)]
    return float(np.sqrt((known**2).mean())) if known.size else float("nan")


def _as_angles(values: NDArray[np.float64]) -> tuple[float, float, float]:
    yaw, pitch, roll = map(float, values)
    return yaw, pitch, roll
