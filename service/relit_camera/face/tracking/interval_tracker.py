"""Tracking at a fraction of the frame rate: a tracker measures every n-th frame, optical flow carries it on between.

A measurement costs ten times as much as the flow. Dense inverse search (DIS, Kroeger et al. 2016) on a small grey
picture of the face moves every landmark by itself, and the head pose is fitted anew. The lips move as
`face.tracking.lip_regression` has learned from the measured frames.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import DisplayImage, Frame, Points
from relit_camera.face.face_state import FaceState, FaceStatus, Tracker
from relit_camera.face.head_pose import fit_pose
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.landmarks.rotated_crop import bounding_box
from relit_camera.face.tracking.lip_regression import LipRegression

GreyPicture = NDArray[np.uint8]


@dataclass(frozen=True)
class FlowTunables:
    """Constants of the flow between measurements (docs/trackers.md, Tracking every second frame).

    Attributes:
        side_px: longer side of the small grey picture.
        finest_scale: the flow is found down to pictures of side_px / 2 ** finest_scale pixels.
        margin: side of the picture's square region over the longer side of the box around the landmarks.
        min_correlation: of the small pictures of two frames; below it the picture was cut, and the frame is measured.
        max_motion: largest motion of the eyes between two frames, in eye spans; beyond it the frame is measured.
        max_gap_s: longest time between two frames; after a longer one the frame is measured.
    """

    side_px: int = 96
    finest_scale: int = 1
    margin: float = 1.3
    min_correlation: float = 0.75
    max_motion: float = 0.25
    max_gap_s: float = 0.2


TUNABLES = FlowTunables()


@dataclass(frozen=True, eq=False)
class _TrackedFrame:
    """The last frame, as far as the next one needs it.

    Attributes:
        state: the face in it.
        size: width and height of the picture.
        time_s: time of the frame.
        region: x, y, width and height in pixels: what the small picture shows.
        small: uint8 grey.
    """

    state: FaceState
    size: tuple[int, int]
    time_s: float
    region: tuple[int, int, int, int]
    small: GreyPicture


class IntervalTracker:
    """A `face.face_state.Tracker` that lets another one measure every `interval`-th frame.

    Where the flow could be wrong, the frame is measured in any case: there was no certain face, the picture was cut,
    the face jumped, or the time went back or stood still.
    """

    def __init__(self, tracker: Tracker, interval: int = 1) -> None:
        """Measure with `tracker`, each frame for an interval of 1.

        Raises:
            InputError: the interval is less than 1.
        """
        self.name = tracker.name
        self.scheme = tracker.scheme
        self._tracker = tracker
        self._scheme = landmark_scheme(tracker.scheme)
        self._lips = LipRegression(self._scheme)
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
        self._flow.setFinestScale(TUNABLES.finest_scale)
        self._interval, self._follow_lips = 1, True
        self.set_interval(interval)
        self.reset()

    def set_interval(self, frames: int, follow_lips: bool = True) -> None:
        """Measure every so many frames from now on. Between two calls of `track`, and from their thread.

        Args:
            frames: from one measurement to the next.
            follow_lips: whether the lips follow what was learned of them, or the flow as the rest of the face does.

        Raises:
            InputError: it is less than 1.
        """
        if frames < 1:
            raise InputError(f"a tracker cannot measure every {frames} frames", "give an interval of 1 or more")
        if (frames, follow_lips) != (self._interval, self._follow_lips):
            self._lips.reset()  # what it learned before may be another person's by now
        self._interval, self._follow_lips = frames, follow_lips

    @property
    def interval(self) -> int:
        """Frames from one measurement to the next."""
        return self._interval

    def reset(self) -> None:
        """Forget the face: the next frame is measured, and searched whole."""
        self._tracker.reset()
        self._lips.reset()
        self._last: _TrackedFrame | None = None
        self._since_measured = 0

    def track(self, frame: Frame) -> FaceState:
        """Measure the face in `frame`, or follow it from the frame before."""
        self._since_measured += 1
        state = self._follow(frame) if self._since_measured < self._interval else None
        if state is None:
            state = self._tracker.track(frame)
            self._since_measured = 0
            self._learn(frame, state)
        self._last = self._remember(frame, state) if self._since_measured + 1 < self._interval else None
        return state

    def _learn(self, frame: Frame, state: FaceState) -> None:
        if state.pose is None:
            self._lips.reset()
        elif self._interval > 1 and self._follow_lips and state.status is FaceStatus.FOUND:
            self._lips.learn(frame.image, state.landmarks, state.pose)

    def _remember(self, frame: Frame, state: FaceState) -> _TrackedFrame | None:
        """What the next frame needs to follow this one, if it can."""
        if state.status is not FaceStatus.FOUND or state.pose is None:
            return None
        region = _region(state.landmarks, frame.size)
        if region is None:
            return None
        return _TrackedFrame(state, frame.size, frame.time_s, region, _small_picture(frame.image, region))

    def _follow(self, frame: Frame) -> FaceState | None:
        """The face in `frame` by the flow from the last one; None where that could be wrong."""
        last = self._last
        if last is None:
            return None
        if frame.size != last.size or not 0 < frame.time_s - last.time_s <= TUNABLES.max_gap_s:
            self._lips.reset()
            return None
        small = _small_picture(frame.image, last.region)
        if _correlation(last.small, small) < TUNABLES.min_correlation:
            self._lips.reset()  # it may be another person
            return None
        landmarks = self._moved(last, self._flow.calc(last.small, small, None))
        pose = fit_pose(landmarks, self._scheme, frame.size, last.state.pose.focal_px if last.state.pose else None)
        if pose is None or self._motion(last.state.landmarks, landmarks) > TUNABLES.max_motion:
            return None
        if self._follow_lips:
            landmarks = self._lips.corrected(frame.image, landmarks, pose)
        return replace(
            last.state,
            landmarks=landmarks,
            pose=pose,
            eyes=self._scheme.eyes_opening(landmarks),
            mouth=self._scheme.mouth_opening(landmarks),
        )

    def _moved(self, last: _TrackedFrame, flow: NDArray[np.float32]) -> Points:
        """The last landmarks, each moved by the flow (rows, columns, 2) at its place."""
        x, y, width, height = last.region
        rows, columns = last.small.shape
        scale = np.array([columns / width, rows / height], np.float32)
        places = (last.state.landmarks - np.array([x, y], np.float32)) * scale - np.float32(0.5)
        ways = cv2.remap(flow, places[:, None], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[:, 0]
        return np.asarray(last.state.landmarks + ways / scale, dtype=np.float32)

    def _motion(self, before: Points, now: Points) -> float:
        """How far the eyes have moved, in eye spans."""
        way = math.dist(self._scheme.eyes_center(now), self._scheme.eyes_center(before))
        return way / self._scheme.eye_span(before)


def _region(landmarks: Points, size: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """The part of the picture around the landmarks, (x, y, width, height); None where hardly any of it is inside."""
    x, y, width, height = bounding_box(landmarks)
    half = TUNABLES.margin * max(width, height) / 2
    center_x, center_y = x + width / 2, y + height / 2
    left, right = max(round(center_x - half), 0), min(round(center_x + half), size[0])
    top, bottom = max(round(center_y - half), 0), min(round(center_y + half), size[1])
    if min(right - left, bottom - top) < half / 2 or half < 8:
        return None
    return left, top, right - left, bottom - top


def _small_picture(image: DisplayImage, region: tuple[int, int, int, int]) -> GreyPicture:
    """A region of the picture, grey, its longer side `side_px`."""
    x, y, width, height = region
    scale = TUNABLES.side_px / max(width, height)
    size = (max(round(width * scale), 16), max(round(height * scale), 16))
    # Bilinear: averaging over areas gives the same flow and takes twice the time.
    small = cv2.resize(image[y : y + height, x : x + width], size, interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY))


def _correlation(first: GreyPicture, second: GreyPicture) -> float:
    """Correlation of two grey pictures of the same size, -1..1, by every fourth pixel each way."""
    one, other = (small[::4, ::4].astype(np.float32).ravel() for small in (first, second))
    one -= one.mean()
    other -= other.mean()
    norms = math.sqrt(float(one @ one) * float(other @ other))
    return float(one @ other) / norms if norms > 0 else 0.0
