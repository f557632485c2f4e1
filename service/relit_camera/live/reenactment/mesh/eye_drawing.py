"""Closing eyes, drawn pixel by pixel over the moved picture.

The edge of a lid before the eyeball is finer than the cells in which the warp's positions are computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import Box, LinearImage, RgbaImage
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.live.reenactment.mesh.eye_mesh import EyeMesh
from relit_camera.live.reenactment.mesh.face_mesh import SurfacePatch
from relit_camera.live.reenactment.mesh.triangle_drawing import draw_triangles
from relit_camera.live.reenactment.source_image import UPSAMPLING

REACH = 0.15
"""Of an eye's width beside its lids, over which what is drawn fades out."""
SUBPIXELS = 2
"""Positions that are computed and averaged in a pixel, side by side."""
WHOLE = 0.99
"""Share of a pixel that counts as all of it."""
LEAST_SIDE_PX = 4
"""Smaller parts of the picture are not drawn."""


@dataclass(frozen=True)
class EyeTask:
    """What is drawn of one closing eye.

    Attributes:
        box: left, top, right, bottom in pixels of the moved picture.
        looks: (rows, columns, 2) float32 source pixels, `SUBPIXELS` times as many as pixels or as many.
        cover: (height, width) float32 how far it shows.
        source: (4,) int left, top, right, bottom of the part of the source image that it looks at, in pixels.
    """

    box: Box
    looks: NDArray[np.float32]
    cover: NDArray[np.float32]
    source: NDArray[np.intp]

    def draw(self, image: RgbaImage, relit: LinearImage) -> None:
        """Draw into the moved picture, in place, from the relit source image; its alpha stays."""
        height, width = relit.shape[:2]
        low = np.clip(self.source[:2], 0, (width - 1, height - 1))
        high = np.clip(self.source[2:], low + 1, (width, height))
        part = display_from_linear(np.ascontiguousarray(relit[low[1] : high[1], low[0] : high[0]]))
        part = cv2.resize(part, None, fx=UPSAMPLING, fy=UPSAMPLING, interpolation=cv2.INTER_CUBIC)
        places = (self.looks - low.astype(np.float32)) * np.float32(UPSAMPLING) - np.float32(0.5)
        drawn = cv2.remap(part, places, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        left, top, right, bottom = self.box
        area = image[top:bottom, left:right]
        drawn = cv2.resize(drawn, area.shape[1::-1], interpolation=cv2.INTER_AREA)
        below = cv2.cvtColor(area, cv2.COLOR_RGBA2RGB)
        area[..., :3] = cv2.blendLinear(drawn, below, self.cover, cv2.subtract(1.0, self.cover))


def plan_closing_eyes(
    eyes: Sequence[EyeMesh],
    closing: Sequence[float],
    surface: SurfacePatch,
    landmarks: NDArray[np.float64],
    to_picture: NDArray[np.float64],
    size: tuple[int, int],
    half_size: bool = False,
) -> list[EyeTask]:
    """What is to be drawn of eyes that close.

    Args:
        eyes: of the source image.
        closing: of each, see `EyeMesh.meet_lids`.
        surface: the moved mesh.
        landmarks: (count, 2) where all landmarks go, source pixels.
        to_picture: (2, 3) source pixels → pixels of the moved picture.
        size: (width, height) of that.
        half_size: at one position a pixel.
    """
    if not any(closing):
        return []
    tasks, fine = [], 1 if half_size else SUBPIXELS
    corners = surface.corners @ to_picture[:, :2].T + to_picture[:, 2]
    for eye, share in zip(eyes, closing, strict=True):
        if share == 0:
            continue
        lids = landmarks[eye.lids] @ to_picture[:, :2].T + to_picture[:, 2]
        margin = max(REACH * float(np.ptp(lids[:, 0])), 1.0)
        low = np.maximum(np.floor(lids.min(axis=0) - margin), 0).astype(int)
        high = np.minimum(np.ceil(lids.max(axis=0) + margin), size).astype(int)
        if (high - low < LEAST_SIDE_PX).any():
            continue
        near = ((corners.max(axis=1) > low) & (corners.min(axis=1) < high)).all(axis=1)
        width, height = (int(side) for side in high - low)
        x, y, trust = draw_triangles(
            fine * (corners[near] - low) - 0.5, surface.values[near], (fine * height, fine * width)
        )
        within = np.minimum.outer(_inward(height) / margin, _inward(width) / margin).clip(0, 1)
        # A pixel of which a part is not drawn has no color.
        known = cv2.resize((x != 0).astype(np.float32), (width, height), interpolation=cv2.INTER_AREA) > WHOLE
        cover = cv2.resize(trust, (width, height), interpolation=cv2.INTER_AREA) * np.float32(share) * within * known
        box = (int(low[0]), int(low[1]), int(high[0]), int(high[1]))
        tasks.append(EyeTask(box, cv2.merge([x, y]), np.asarray(cover, np.float32), eye.surroundings))
    return tasks


def _inward(count: int) -> NDArray[np.float32]:
    """Distance of pixels from the nearer end of a row of them."""
    middles = np.arange(count, dtype=np.float32) + np.float32(0.5)
    return np.asarray(np.minimum(middles, middles[::-1]))
