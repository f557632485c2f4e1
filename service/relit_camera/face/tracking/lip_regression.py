"""Where the lips are, read off a small picture of the mouth by a regression, learned from measured frames as they come.

Optical flow hardly sees a mouth open, since what appears inside was not there before. But how a mouth looks tells how
far it is open, and a person's mouth looks alike every time: a second of measured frames is enough to begin with.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.face.head_pose import HeadPose, project, unproject
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme


@dataclass(frozen=True)
class LipTunables:
    """Constants of the regression (docs/trackers.md, Tracking every second frame).

    Attributes:
        columns, rows: of the small picture of the mouth.
        half_width_cm, half_height_cm: what it shows, about the middle of the lips and `below_cm` further down.
        least_frames: measured frames before it predicts.
        most_frames: measured frames that it remembers.
        ridge: regularization, in variances of a pixel a frame.
        noise: grey values of contrast below which a picture says less.
        weight: of the regression against the flow; errors of both partly cancel.
        max_correction: of the flow's lips, rms in eye spans; beyond it something else is before the mouth.
    """

    columns: int = 24
    rows: int = 18
    half_width_cm: float = 3.6
    half_height_cm: float = 3.2
    below_cm: float = 0.6
    least_frames: int = 15
    most_frames: int = 60
    ridge: float = 0.1
    noise: float = 5.0
    weight: float = 0.7
    max_correction: float = 0.12


TUNABLES = LipTunables()


@dataclass(frozen=True, eq=False)
class _Mouth:
    """A mouth in one frame: its picture (pixels,) float32 without mean and contrast, and the lips in head space."""

    pixels: NDArray[np.float32]
    lips: NDArray[np.float64]


class LipRegression:
    """Ridge regression from pictures of the mouth to the lips in head space, (lips, 3) centimetres.

    `learn` takes a measured frame; `corrected` places the lips in a later one, by the change since the last measured
    one.
    """

    def __init__(self, scheme: LandmarkScheme) -> None:
        self._scheme = scheme
        self._lips = np.array(scheme.lips)
        x, y, z = scheme.canonical[self._lips].mean(axis=0)
        across = x + np.linspace(-1, 1, TUNABLES.columns) * TUNABLES.half_width_cm
        down = y - TUNABLES.below_cm + np.linspace(1, -1, TUNABLES.rows) * TUNABLES.half_height_cm
        grid_x, grid_y = np.meshgrid(across, down)
        self._grid = np.stack([grid_x.ravel(), grid_y.ravel(), np.full(grid_x.size, z)], axis=1)
        self._learned: deque[_Mouth] = deque(maxlen=TUNABLES.most_frames)

    def reset(self) -> None:
        """Forget all frames: another person may come."""
        self._learned.clear()

    def learn(self, image: DisplayImage, landmarks: Points, pose: HeadPose) -> None:
        """Take a measured frame, its landmarks (count, 2) and its pose."""
        size = (image.shape[1], image.shape[0])
        lips = unproject(landmarks, pose, self._scheme, size)[self._lips]
        self._learned.append(_Mouth(self._pixels(image, pose), lips))

    def corrected(self, image: DisplayImage, landmarks: Points, pose: HeadPose) -> Points:
        """Landmarks (count, 2) that flow has moved, with the lips where the picture of the mouth says they are."""
        if len(self._learned) < TUNABLES.least_frames:
            return landmarks
        ways = TUNABLES.weight * (self._predicted(image, pose) - landmarks[self._lips])
        if float(np.sqrt((ways**2).sum(axis=1).mean())) > TUNABLES.max_correction * self._scheme.eye_span(landmarks):
            return landmarks
        result = landmarks.copy()
        result[self._lips] += ways
        return result

    def _predicted(self, image: DisplayImage, pose: HeadPose) -> Points:
        last = self._learned[-1]
        change = self._pixels(image, pose) - last.pixels
        pixels = np.array([mouth.pixels for mouth in self._learned])
        pixels -= pixels.mean(axis=0)
        lips = np.array([mouth.lips for mouth in self._learned])
        kernel = pixels @ pixels.T
        kernel[np.diag_indices_from(kernel)] += TUNABLES.ridge * len(kernel)
        weights = np.linalg.solve(kernel, pixels @ change)
        moved = last.lips + np.tensordot(weights, lips - lips.mean(axis=0), 1)
        return project(moved, pose, (image.shape[1], image.shape[0]))

    def _pixels(self, image: DisplayImage, pose: HeadPose) -> NDArray[np.float32]:
        places = project(self._grid, pose, (image.shape[1], image.shape[0])) - np.float32(0.5)
        colors = cv2.remap(image, places[:, None], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        grey = colors.reshape(-1, 3) @ np.full(3, 1 / 3, np.float32)
        return np.asarray((grey - grey.mean()) / (grey.std() + TUNABLES.noise), dtype=np.float32)
