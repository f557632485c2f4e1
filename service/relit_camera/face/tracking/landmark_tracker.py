"""The tracking loop: initialized by the face detector, continued by a landmark network, checked by the detector.

A landmark network is fast and precise, but its confidence says only that it sees a face: after a jump it may stay on
the forehead at full confidence. So the detector, slower and coarser, checks it every few frames, and at once after a
cut: `FacePatch` notices that the picture has suddenly changed where the face was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, Frame, Points
from relit_camera.face.detection.face_detector import (
    Box,
    Detection,
    FaceDetector,
    intersection_over_union,
    is_same_face,
)
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.head_pose import fit_pose
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme
from relit_camera.face.landmarks.rotated_crop import Crop, bounding_box


@dataclass(frozen=True)
class TrackingTunables:
    """Thresholds of the tracking loop (docs/trackers.md, Why there is a detector behind the landmarks).

    Attributes:
        patch_side_px: side of the thumbnail by which cuts are detected.
        min_correlation: of that thumbnail with the next frame. Between frames of talking and turning people it stays
            above 0.67, except at 12 frames a second with quick turns (0.60); after a jump of half an eye distance it is
            nearly always below 0.65.
        max_eye_offset: largest distance between the detector's eyes and the landmarks', in eye distances.
        max_detector_roll_deg: roll beyond which the detector's eyes are unreliable and overlapping boxes decide.
        large_motion: motion between frames, in eye spans, after which the crop is placed anew and checked.
        checks_before_other_face: failed checks after which a face elsewhere is taken over.
        checks_before_lost: failed checks after which the face is lost.
    """

    patch_side_px: int = 24
    min_correlation: float = 0.65
    max_eye_offset: float = 0.35
    max_detector_roll_deg: float = 30.0
    large_motion: float = 0.25
    checks_before_other_face: int = 8
    checks_before_lost: int = 30


TUNABLES = TrackingTunables()


class FacePatch:
    """The landmarks of one frame, and a thumbnail of the picture around them.

    Attributes:
        points: (count, 2) float32 landmarks.
    """

    def __init__(self, image: DisplayImage, points: Points) -> None:
        """Take a thumbnail of the upright box around the landmarks."""
        self.points, self._size = points, image.shape
        x, y, width, height = bounding_box(points)
        rows, columns = image.shape[:2]
        # The part of the box that is in the picture, and at least one pixel.
        left, top = (min(max(round(start), 0), side - 1) for start, side in ((x, columns), (y, rows)))
        right, bottom = max(round(x + width), left + 1), max(round(y + height), top + 1)
        self._box = (slice(top, bottom), slice(left, right))
        self._pixels = self._thumbnail(image)

    def matches(self, image: DisplayImage) -> bool:
        """Whether the next frame has the same size, and correlates with the thumbnail at the same place."""
        if image.shape != self._size:
            return False
        now = self._thumbnail(image)
        norms = math.sqrt(float(self._pixels @ self._pixels) * float(now @ now))
        return float(self._pixels @ now) >= TUNABLES.min_correlation * norms

    def _thumbnail(self, image: DisplayImage) -> NDArray[np.float32]:
        """The thumbnail's luma without its mean."""
        side = TUNABLES.patch_side_px
        small = cv2.resize(image[self._box], (side, side), interpolation=cv2.INTER_LINEAR)
        luma = cv2.cvtColor(small, cv2.COLOR_RGB2GRAY).astype(np.float32).ravel()
        luma -= luma.mean()
        return np.asarray(luma, dtype=np.float32)


@dataclass(frozen=True, eq=False)
class LandmarkPrediction:
    """Landmarks that a network predicts in one crop, with its confidence.

    Attributes:
        points: (count, 2) float32 pixels of the picture.
        confidence: 0..1, of there being a face.
    """

    points: Points
    confidence: float


class LandmarkNetwork(Protocol):
    """A network that places the points of a scheme in a crop."""

    scheme: LandmarkScheme
    threshold: float
    """Confidence under which there is no face."""

    def crop_from_detection(self, detection: Detection) -> Crop:
        """Crop to start with."""
        ...

    def crop_from_points(self, points: Points) -> Crop:
        """Crop to go on with, from the points of the frame before."""
        ...

    def read(self, image: DisplayImage, crop: Crop) -> LandmarkPrediction:
        """Place the points."""
        ...

    def blendshapes(self, points: Points) -> Mapping[str, float]:
        """ARKit-named scores of these points, empty where the network has none."""
        ...


class LandmarkTracker:
    """A `face.face_state.Tracker` made of a detector and a landmark network.

    Attributes:
        besides: boxes of faces that others follow: it leaves them alone.
    """

    def __init__(
        self,
        name: str,
        network: LandmarkNetwork,
        detector: FaceDetector,
        focal_px: float | None = None,
        check_every: int = 10,
    ) -> None:
        self.name = name
        self.scheme = network.scheme.name
        self._network = network
        self._detector = detector
        self._focal_px = focal_px
        self._check_every = check_every
        self.besides: tuple[Box, ...] = ()
        self.reset()

    def beside(self) -> LandmarkTracker:
        """A tracker of another face by the same networks, for the same thread."""
        return LandmarkTracker(self.name, self._network, self._detector, self._focal_px, self._check_every)

    def faces(self, image: DisplayImage) -> list[Detection]:
        """Every face in a picture."""
        return self._detector.detect_all(image)

    def reset(self) -> None:
        """Forget the face: the next frame is searched by the detector."""
        self._last: FacePatch | None = None
        self._frames_since_check = 0
        self._failed_checks = 0

    def track(self, frame: Frame) -> FaceState:
        """Measure the face in `frame`."""
        return self._state(frame, *self._locate(frame.image))

    def take(self, frame: Frame, detection: Detection) -> FaceState:
        """Measure the face that is detected in `frame`, to follow it from now on."""
        return self._state(frame, *self._start(frame.image, detection))

    def _state(self, frame: Frame, status: FaceStatus, reading: LandmarkPrediction | None) -> FaceState:
        if reading is None:
            self.reset()
            return LOST
        self._last = FacePatch(frame.image, reading.points)
        scheme = self._network.scheme
        pose = fit_pose(reading.points, scheme, frame.size, self._focal_px)
        if pose is None:
            self.reset()
            return LOST
        return FaceState(
            status=status,
            confidence=reading.confidence * (1.0 if status is FaceStatus.FOUND else 0.5),
            scheme=scheme.name,
            landmarks=reading.points,
            pose=pose,
            eyes=scheme.eyes_opening(reading.points),
            mouth=scheme.mouth_opening(reading.points),
            blendshapes=self._network.blendshapes(reading.points),
        )

    def _locate(self, image: DisplayImage) -> tuple[FaceStatus, LandmarkPrediction | None]:
        reading = self._track_from_previous(image, self._last.points) if self._last else None
        if self._last is None or reading is None:
            detection = self._detector.detect(image, besides=self.besides)
            return self._start(image, detection) if detection else (FaceStatus.LOST, None)
        self._frames_since_check += 1
        cut = not self._last.matches(image)
        if cut or self._failed_checks or self._frames_since_check >= self._check_every:
            return self._check(image, reading, cut)
        return FaceStatus.FOUND, reading

    def _track_from_previous(self, image: DisplayImage, last: Points) -> LandmarkPrediction | None:
        """Read a crop around the last points; None where there is no face."""
        reading = self._network.read(image, self._network.crop_from_points(last))
        if reading.confidence >= self._network.threshold and self._moved_far(last, reading.points):
            # The crop no longer fits: read again around the new points, and let the detector check them.
            self._frames_since_check = self._check_every
            reading = self._network.read(image, self._network.crop_from_points(reading.points))
        box = bounding_box(reading.points)
        overlap = intersection_over_union(box, bounding_box(last))
        slid = any(intersection_over_union(box, each) > overlap for each in self.besides)
        return None if slid or reading.confidence < self._network.threshold else reading

    def _start(self, image: DisplayImage, detection: Detection) -> tuple[FaceStatus, LandmarkPrediction | None]:
        """Read a crop around a detection, then one around the points found: the detection's box is coarse."""
        first = self._network.read(image, self._network.crop_from_detection(detection))
        reading = self._network.read(image, self._network.crop_from_points(first.points))
        self._frames_since_check = 0
        if reading.confidence < self._network.threshold:
            return FaceStatus.LOST, None
        return self._judge(reading, agrees=self._agrees(reading, detection))

    def _check(
        self, image: DisplayImage, reading: LandmarkPrediction, cut: bool
    ) -> tuple[FaceStatus, LandmarkPrediction | None]:
        """Compare a reading with the detector, and start anew where they disagree.

        After a `cut` a face that is detected elsewhere is tracked at once.
        """
        self._frames_since_check = 0
        box = bounding_box(reading.points)
        nearby = self._detector.detect_nearby(image, box)
        if nearby and is_same_face(nearby.box, box) and self._agrees(reading, nearby):
            return self._judge(reading, agrees=True)
        detection = self._detector.detect(image, near=box, besides=self.besides)
        if detection is None or not is_same_face(detection.box, box):
            # The detector misses profiles, so this alone is no proof that the face is gone.
            status, kept = self._judge(reading, agrees=False)
            if detection and (cut or self._failed_checks > TUNABLES.checks_before_other_face):
                return self._start(image, detection)
            return (status, kept) if self._failed_checks <= TUNABLES.checks_before_lost else (FaceStatus.LOST, None)
        if self._agrees(reading, detection):
            return self._judge(reading, agrees=True)
        return self._start(image, detection)

    def _judge(self, reading: LandmarkPrediction, agrees: bool) -> tuple[FaceStatus, LandmarkPrediction]:
        self._failed_checks = 0 if agrees else self._failed_checks + 1
        return (FaceStatus.FOUND if agrees else FaceStatus.UNCERTAIN), reading

    def _agrees(self, reading: LandmarkPrediction, detection: Detection) -> bool:
        eyes = self._network.scheme.eye_centers(reading.points)
        across = eyes[1] - eyes[0]
        if abs(np.degrees(np.arctan2(across[1], across[0]))) > TUNABLES.max_detector_roll_deg:
            return is_same_face(detection.box, bounding_box(reading.points))
        # In profile the eyes lie close together: there the face's height is the better yardstick.
        unit = max(float(np.linalg.norm(across)), 0.25 * detection.box[3])
        return float(np.linalg.norm(eyes.mean(axis=0) - detection.eyes.mean(axis=0))) <= TUNABLES.max_eye_offset * unit

    def _moved_far(self, before: Points, now: Points) -> bool:
        scheme = self._network.scheme
        motion = math.dist(scheme.eyes_center(now), scheme.eyes_center(before))
        return motion > TUNABLES.large_motion * scheme.eye_span(now)
