"""Square crops of a head, alike from the source image and from live frames, as published reenactors want them."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.rotated_crop import Crop
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.face.motion.neutral_face import NeutralFace
from relit_camera.live.reenactment.control_points import NECK_PIVOT

CROP_CENTER = np.array([0.0, 1.0, 0.0])
"""What lies in a crop's middle, head axes, cm: a little above the middle of the face, so that the hair is in it."""
SIDE_CM = 32.0
"""Side of a crop at the head's distance. A face of 17 cm fills about half of it, as in the networks' training data."""
NEUTRAL_UPDATE_RATIO = 0.5
"""A later frame is taken for the neutral face when it is nearer to it by this factor: no chain of small jumps."""


def head_crop(pose: HeadPose, size: tuple[int, int]) -> Crop:
    """The upright square round a head under `pose` in a picture of `size` (width, height).

    It goes by the pose, which the landmarks' rigid points give, not by their box: an open mouth does not move it.
    """
    x, y = project(CROP_CENTER[None], pose, size)[0]
    depth = pose.depth_of(CROP_CENTER)
    side = SIDE_CM * pose.focal_px / depth
    return Crop((float(x), float(y)), side, side)


def tracked_head_crop(neutral: HeadPose, now: HeadPose, size: tuple[int, int]) -> Crop:
    """The crop of a neutral head, gone along with the neck: the head turns within it, the person stays in place."""
    crop = head_crop(neutral, size)
    was, is_ = (project(NECK_PIVOT[None], pose, size)[0] for pose in (neutral, now))
    scale = neutral.depth_of(NECK_PIVOT) / max(now.depth_of(NECK_PIVOT), 1.0)
    x, y = is_ + scale * (np.array(crop.center) - was)
    return Crop((float(x), float(y)), scale * crop.width, scale * crop.height)


def crop_square(image: DisplayImage, crop: Crop, side: int) -> DisplayImage:
    """The crop as (side, side, 3) uint8, shrunk without aliasing; black beyond the picture."""
    shrink = int(crop.width // side)
    if shrink > 1:
        height, width = image.shape[:2]
        small = cv2.resize(image, (-(-width // shrink), -(-height // shrink)), interpolation=cv2.INTER_AREA)
        image = np.asarray(small, dtype=np.uint8)
        across, down = image.shape[1] / width, image.shape[0] / height
        crop = Crop((crop.center[0] * across, crop.center[1] * down), crop.width * across, crop.height * down)
    return crop.cut(image, side, side)


class DrivingCrops:
    """The live head as a network sees it; while it is lost, as it was seen last.

    Attributes:
        driving: (side, side, 3) uint8 sRGB; None before the first face.
        initial: the same of the frame that was nearest to the neutral face.
    """

    def __init__(self, side: int) -> None:
        self.driving: DisplayImage | None = None
        self.initial: DisplayImage | None = None
        self._side = side
        self._neutral: NeutralFace | None = None
        self._distance_to_neutral = np.inf

    def update(self, motion: FaceMotion, frame: Frame) -> None:
        """Look at the next frame."""
        pose, neutral = motion.pose, motion.neutral
        if motion.status is FaceStatus.LOST or pose is None or neutral is None:
            return
        crop = tracked_head_crop(neutral.pose, pose, frame.size)
        self.driving = crop_square(frame.image, crop, self._side)
        if neutral is not self._neutral:
            self._neutral, self._distance_to_neutral = neutral, np.inf
        at_rest = project(neutral.points, neutral.pose, frame.size)
        distance_to_neutral = float(np.linalg.norm(motion.landmarks - at_rest, axis=1).mean()) / crop.width
        if distance_to_neutral < NEUTRAL_UPDATE_RATIO * self._distance_to_neutral or self.initial is None:
            self.initial, self._distance_to_neutral = self.driving, distance_to_neutral
