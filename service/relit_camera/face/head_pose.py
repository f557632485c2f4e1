"""Head pose: the rigid fit of the canonical face to landmarks, and projection between pixels and head-space points.

Axes and projection are those of `HeadPose`. OpenCV's camera looks along +Z with Y down, so its frame is ours rotated by
180° about X: x_cv = (x, −y, −z).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Points
from relit_camera.base.rotations import Rotation
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme


@dataclass(frozen=True)
class HeadPose:
    """Pose of the head, camera_from_head: x_camera = rotation · x_head + translation.

    Axes of both frames: X right in the picture, Y up, Z toward the camera; the camera is at the origin, so a visible
    head has translation z < 0. Projection: x_px = cx + focal_px · X / −Z, y_px = cy − focal_px · Y / −Z about the
    picture's centre (cx, cy) = (width / 2, height / 2), and off it by `axis_px` in one that was cut.

    Attributes:
        rotation: camera_from_head; identity is a face looking along +Z into the camera.
        translation: (3,) float64 centimetres, of the canonical face's origin.
        focal_px: focal length used for the fit, in pixels.
        axis_px: x and y from the picture's centre to where the camera's axis meets the picture.
    """

    rotation: Rotation
    translation: NDArray[np.float64]
    focal_px: float
    axis_px: tuple[float, float] = (0.0, 0.0)

    def depth_of(self, point: NDArray[np.float64]) -> float:
        """Distance in centimetres, along the camera's axis, from the camera to a head-space point (3,)."""
        return float(-(self.rotation.apply(point) + self.translation)[2])

    @property
    def turn_deg(self) -> float:
        """Angle between the nose and the direction from the head to the camera, in degrees."""
        toward = -self.translation / np.linalg.norm(self.translation)
        return float(np.degrees(np.arccos(np.clip(self.rotation.as_matrix()[:, 2] @ toward, -1, 1))))


_CV_FROM_OURS = np.array([1.0, -1.0, -1.0])


def guess_focal(size: tuple[int, int]) -> float:
    """Focal length in pixels of a typical webcam, whose longer side spans 53 degrees. `size` is (width, height)."""
    return float(max(size))


def fit_pose(
    landmarks: Points, scheme: LandmarkScheme, size: tuple[int, int], focal_px: float | None = None
) -> HeadPose | None:
    """Fit the scheme's rigid points to `landmarks` (count, 2); None where no head before the camera fits.

    SQPnP (Terzakis and Lourakis 2020) finds the global minimum of an algebraic error, Levenberg-Marquardt refines it
    to the least squares in pixels. It is stateless, so a bad frame does not affect the next.

    Args:
        landmarks: (count, 2) float32 pixels, pixel centres at integers + ½.
        scheme: what the landmarks are.
        size: width and height of the picture.
        focal_px: focal length if known, else `guess_focal`.
    """
    focal = focal_px or guess_focal(size)
    camera, model = _camera_matrix(focal, size), _rigid_model(scheme)
    pixels = landmarks[scheme.rigid_indices].astype(np.float64)
    if not np.isfinite(pixels).all():
        return None
    try:
        found, turn, shift = cv2.solvePnP(model, pixels, camera, None, flags=cv2.SOLVEPNP_SQPNP)
        if not found:
            return None
        turn, shift = cv2.solvePnPRefineLM(model, pixels, camera, None, turn, shift)
    except cv2.error:  # OpenCV raises it for degenerate points
        return None
    translation = shift.ravel() * _CV_FROM_OURS
    if not (all(map(math.isfinite, (*shift.flat, *turn.flat))) and translation[2] < 0):
        return None
    # The rotation vector transforms like any vector.
    return HeadPose(Rotation.from_rotvec(turn.ravel() * _CV_FROM_OURS), translation, focal)


@lru_cache(maxsize=8)
def _camera_matrix(focal_px: float, size: tuple[int, int]) -> NDArray[np.float64]:
    """OpenCV's camera matrix (3, 3), its principal point in the middle of a picture of `size` (width, height)."""
    return np.array([[focal_px, 0, size[0] / 2], [0, focal_px, size[1] / 2], [0, 0, 1]])


@lru_cache(maxsize=8)
def _rigid_model(scheme: LandmarkScheme) -> NDArray[np.float64]:
    """(rigid, 3): the rigid points of a scheme in OpenCV's axes."""
    return np.asarray(scheme.rigid_canonical * _CV_FROM_OURS)


def project(points: NDArray[np.float64], pose: HeadPose, size: tuple[int, int]) -> Points:
    """Pixels (count, 2) float32 of head-space points (count, 3) in centimetres under `pose`."""
    camera_points = points @ pose.rotation.as_matrix().T + pose.translation
    across = camera_points[:, :2] * (np.array([-pose.focal_px, pose.focal_px]) / camera_points[:, 2:])
    return (across + _axis(pose, size)).astype(np.float32)


def unproject(landmarks: Points, pose: HeadPose, scheme: LandmarkScheme, size: tuple[int, int]) -> NDArray[np.float64]:
    """Head-space points (count, 3) in centimetres: each landmark's ray at the depth of its canonical point.

    The depth is that of the mean face; deviations from it are measured in the picture plane only. The inverse of
    `project` for points at those depths.
    """
    camera_from_head = pose.rotation.as_matrix()
    depth = -(scheme.canonical @ camera_from_head[2] + pose.translation[2])
    camera_points = np.empty((len(landmarks), 3))
    camera_points[:, :2] = (landmarks - _axis(pose, size)) * np.array([1 / pose.focal_px, -1 / pose.focal_px])
    camera_points[:, 2] = -1
    camera_points *= depth[:, None]
    camera_points -= pose.translation
    return np.asarray(camera_points @ camera_from_head)


def _axis(pose: HeadPose, size: tuple[int, int]) -> NDArray[np.float64]:
    """Where the camera's axis meets a picture of `size` (width, height), (2,) in pixels."""
    return np.array(size) / 2 + pose.axis_px
