"""Where a head has moved since a tracker last saw it, by sparse optical flow: what moves the source image at rest.

It needs neither tracker nor network: while those fail or hang, a head that moves aside or nearer is still followed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.rotations import Rotation
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.landmarks.rotated_crop import bounding_box
from relit_camera.face.motion.face_follower import FaceMotion

GreyPicture = NDArray[np.uint8]


@dataclass(frozen=True)
class MovementTunables:
    """Constants of the flow.

    Attributes:
        face_px: longer side of the face in the small grey pictures that are compared.
        corners: most points that are followed.
        min_agreeing: fewer points than this that move as one are no head.
        min_agreeing_share: share of the points found at first that must still move as one.
        max_error_px: how far a point may be from where all together go, in small pixels.
        ease_s: how long it takes to come to rest where the head is no longer found, and to follow it again.
    """

    face_px: float = 96.0
    corners: int = 60
    min_agreeing: int = 8
    min_agreeing_share: float = 0.3
    max_error_px: float = 4.0
    ease_s: float = 0.5


TUNABLES = MovementTunables()


@dataclass(frozen=True, eq=False)
class _Reference:
    """The last tracked frame, as later ones are compared with it.

    Attributes:
        small: uint8 grey picture.
        scale: its size over that of the frame.
        points: (count, 2) float32 small pixels: what is followed.
        motion: of the face in it.
    """

    small: GreyPicture
    scale: float
    points: NDArray[np.float32]
    motion: FaceMotion


class HeadMovement:
    """Carries the motion of the last tracked frame on to frames that nothing tracks. Not thread-safe."""

    def __init__(self) -> None:
        self._tracked: tuple[Frame, FaceMotion] | None = None
        self._reference: _Reference | None = None
        self._similarity = np.eye(2, 3)
        self._presence, self._time_s = 1.0, 0.0

    def begin_at(self, frame: Frame, motion: FaceMotion | None) -> None:
        """Follow the head from this frame on, in which a tracker found this motion; nothing is computed yet."""
        followed = motion is not None and motion.status is FaceStatus.FOUND and motion.presence > 0
        self._tracked = (frame, motion) if motion is not None and followed else None
        self._reference = None

    def forget(self) -> None:
        """Follow nobody, and keep no frame."""
        self._tracked = self._reference = None

    def motion(self, frame: Frame) -> FaceMotion | None:
        """The motion in this frame: the last one, with the head moved. None while there is none to follow."""
        if self._tracked is not None:
            self._begin(*self._tracked)
            self._tracked = None
        reference = self._reference
        if reference is None:
            return None
        similarity = _similarity(reference, _small_picture(frame.image, reference.scale), self._similarity)
        passed = min(max(frame.time_s - self._time_s, 0.0), TUNABLES.ease_s)
        self._time_s = frame.time_s
        step = passed / TUNABLES.ease_s
        self._presence = float(np.clip(self._presence + (step if similarity is not None else -step), 0.0, 1.0))
        if similarity is not None:
            self._similarity = similarity
        return _moved(reference, self._similarity, float(smoothstep(self._presence)), frame.size)

    def _begin(self, frame: Frame, motion: FaceMotion) -> None:
        left, top, width, height = bounding_box(motion.landmarks)
        scale = min(TUNABLES.face_px / max(width, height, 1.0), 1.0)
        small = _small_picture(frame.image, scale)
        mask = np.zeros_like(small)
        rows, columns = (
            slice(max(round(scale * first), 0), max(round(scale * (first + length)), 0))
            for first, length in ((top, height), (left, width))
        )
        mask[rows, columns] = 255
        points = cv2.goodFeaturesToTrack(small, TUNABLES.corners, 0.01, 3, mask=mask)
        self._similarity, self._presence, self._time_s = np.eye(2, 3), 1.0, frame.time_s
        if points is not None and len(points) >= TUNABLES.min_agreeing:
            self._reference = _Reference(small, scale, np.asarray(points[:, 0], np.float32), motion)


def _small_picture(image: DisplayImage, scale: float) -> GreyPicture:
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY))


def _similarity(reference: _Reference, small: GreyPicture, guess: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """How the points moved since the reference (2, 3), in small pixels; None where too few of them agree."""
    if small.shape != reference.small.shape:
        return None
    # Always from the reference, so that errors do not add up; where the head was a frame ago is only the guess.
    near = (reference.points @ guess[:, :2].T + guess[:, 2]).astype(np.float32)
    points, found, _ = cv2.calcOpticalFlowPyrLK(
        reference.small, small, reference.points, near, winSize=(15, 15), flags=cv2.OPTFLOW_USE_INITIAL_FLOW
    )
    seen = found.ravel() > 0
    needed = max(TUNABLES.min_agreeing, TUNABLES.min_agreeing_share * len(reference.points))
    if seen.sum() < needed:
        return None
    similarity, agreeing = cv2.estimateAffinePartial2D(
        reference.points[seen], points[seen], ransacReprojThreshold=TUNABLES.max_error_px
    )
    return None if similarity is None or agreeing.sum() < needed else np.asarray(similarity, np.float64)


def _moved(
    reference: _Reference, similarity: NDArray[np.float64], presence: float, size: tuple[int, int]
) -> FaceMotion:
    """The reference's motion, with the head moved by a similarity of small pixels and eased to rest by `presence`."""
    motion, pose = reference.motion, reference.motion.pose
    if pose is None:
        return motion
    x, y, z = pose.translation
    center = np.array(size) / 2
    before = center + pose.focal_px * np.array([x, -y]) / -z
    after = similarity[:, :2] @ before + similarity[:, 2] / reference.scale
    depth = -z / max(float(np.hypot(*similarity[:, 0])), 0.1)
    across, down = (after - center) * depth / pose.focal_px
    translation = motion.translation + np.array([across, -down, -depth]) - pose.translation
    rotation = Rotation.from_rotvec(presence * motion.rotation.as_rotvec())
    return replace(motion, rotation=rotation, translation=presence * translation, presence=presence * motion.presence)
