"""Drawing the inside of a mouth that the source image has closed: a dark cavity and the upper teeth.

A warp can only stretch the line between closed lips. What lies behind it was never captured, so it is drawn, lit as the
lips are, and only as far as the lips part more than in the source image.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import DisplayImage, LinearImage, RgbaImage
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.live.reenactment.source_image import SourceFace

CAVITY = np.array([0.035, 0.014, 0.012], dtype=np.float32)
"""The cavity, in the exposure of the source image: dark, and red rather than black."""
TEETH = np.array([0.52, 0.48, 0.41], dtype=np.float32)
"""Teeth lie in the lips' shade, so they read well below white."""
TOOTH_EDGES_CM = np.array([0.0, 0.85, 1.5, 2.25, 2.95])
"""Where the upper teeth meet, from the middle to either side: incisors, canine, premolar."""
TOOTH_GAP_CM, TOOTH_GAP_SHADE = 0.05, 0.22
"""Half width of the line between two teeth, and how dark it is."""
TOOTH_ROW_HALF_WIDTH_CM = 2.6
"""Half width of the row that is seen from the front: beyond it bends back, out of the light."""
TEETH_BELOW_LIP_CM = 0.2
"""How far the upper teeth show below the closed upper lip's edge; they stay with the skull when the lip goes up."""
FULL_OPENING = 0.05
"""Gap, in eye distances, from which the inside is fully shown; it fades in from 0."""
SUBPIXEL_BITS = 4


class MouthInterior:
    """Draws the inside of the mouth of one source image."""

    def __init__(self, face: SourceFace, neutral: DisplayImage) -> None:
        """`neutral` is the source image, uint8 sRGB, softly lit from the front: the lips' look in white light."""
        scheme = face.scheme
        self._face = face
        self._upper, self._lower = list(scheme.upper_lip_inner), list(scheme.lower_lip_inner)
        self._source_gap = self._gap(face.landmarks)
        lips = np.round(face.landmarks[list(scheme.lips)] - 0.5).astype(int)
        self._lips = np.clip(lips, 0, np.array(face.size) - 1)
        self._white = np.maximum(linear_from_uint8(neutral)[self._lips[:, 1], self._lips[:, 0]].mean(axis=0), 0.02)

    def draw(
        self,
        image: RgbaImage,
        relit: LinearImage,
        landmarks: NDArray[np.float64],
        pose: HeadPose,
        to_output: NDArray[np.float64],
    ) -> None:
        """Draw into the moved picture, in place; its alpha stays.

        Args:
            image: (height, width, 4) the moved picture, as the display shows it.
            relit: the relit source image, for the light at the lips.
            landmarks: (count, 2) moved landmarks in source pixels.
            pose: the moved head's pose in the source image's camera.
            to_output: (2, 3) source pixels → pixels of `image`.
        """
        shown = float(np.clip((self._gap(landmarks) - self._source_gap) / FULL_OPENING, 0, 1))
        if shown == 0:
            return
        opening = _transform(to_output, np.vstack([landmarks[self._upper], landmarks[self._lower][::-1]]))
        low = np.maximum(np.floor(opening.min(axis=0)).astype(int) - 3, 0)
        high = np.minimum(np.ceil(opening.max(axis=0)).astype(int) + 4, [image.shape[1], image.shape[0]])
        if (high - low < 3).any():
            return
        shape = (int(high[1] - low[1]), int(high[0] - low[0]))
        softness = max(0.02 * float(np.ptp(opening[:, 0])), 0.5)
        hole = _polygon(opening - low, shape, softness).ravel()
        teeth = _polygon(self._teeth(pose, to_output) - low, shape, 1.5 * softness).ravel()
        row = self._row(pose, to_output, np.arange(shape[1]) + low[0] + 0.5)
        light = relit[self._lips[:, 1], self._lips[:, 0]].mean(axis=0) / self._white
        # Only the pixels of the hole: it fills half of its bounding box.
        pixels = np.flatnonzero(hole)
        if pixels.size == 0:
            return
        covered, shade = teeth.take(pixels)[:, None], row.take(pixels % shape[1])[:, None]
        cavity = CAVITY * light
        inside = cavity + covered * (TEETH * light * shade - cavity)
        area = np.s_[low[1] : high[1], low[0] : high[0]]
        drawn = image[area].reshape(-1, 4)
        around = linear_from_display(np.ascontiguousarray(drawn.take(pixels, axis=0)[None, :, :3]))
        share = hole.take(pixels)[:, None] * np.float32(shown)
        drawn[pixels, :3] = display_from_linear(np.asarray(around + share * (inside - around), np.float32))[0]
        image[area] = drawn.reshape(*shape, 4)

    def _gap(self, landmarks: NDArray) -> float:
        return self._face.scheme.mouth_opening(landmarks.astype(np.float32))

    def _row(self, pose: HeadPose, to_output: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float32]:
        """How bright the teeth are at these `columns` (count,) of the output: darker between them and to the sides."""
        edge = self._face.head_points[self._upper]
        edge = edge[np.argsort(edge[:, 0])]
        seen = _transform(to_output, project(edge, pose, self._face.size))[:, 0]
        across = np.abs(np.interp(columns, np.maximum.accumulate(seen), edge[:, 0] - edge[:, 0].mean()))
        width = max(TOOTH_GAP_CM, float(np.abs(np.gradient(across)).mean()))  # a line no narrower than a pixel
        gap = np.exp(-(((across[:, None] - TOOTH_EDGES_CM) / width) ** 2)).max(axis=1) * (TOOTH_GAP_CM / width)
        return np.asarray(
            np.clip(1.05 - (across / TOOTH_ROW_HALF_WIDTH_CM) ** 2, 0, 1) * (1 - TOOTH_GAP_SHADE * gap), np.float32
        )

    def _teeth(self, pose: HeadPose, to_output: NDArray[np.float64]) -> NDArray[np.float64]:
        edge = self._face.head_points[self._upper]
        # A band from well above the lip to the teeth's edge; the opening cuts it to what is seen.
        band = np.vstack([edge + [0, 1.0, -0.4], (edge - [0, TEETH_BELOW_LIP_CM, 0.4])[::-1]])
        return _transform(to_output, project(band, pose, self._face.size))


def _transform(affine: NDArray[np.float64], points: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.asarray(points @ affine[:, :2].T + affine[:, 2])


def _polygon(points: NDArray[np.float64], shape: tuple[int, int], softness: float) -> NDArray[np.float32]:
    mask = np.zeros(shape, dtype=np.uint8)
    corners = np.round((points - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillPoly(mask, [corners], 255, lineType=cv2.LINE_AA, shift=SUBPIXEL_BITS)
    return np.asarray(cv2.GaussianBlur(mask, (0, 0), softness).astype(np.float32) / np.float32(255), dtype=np.float32)
