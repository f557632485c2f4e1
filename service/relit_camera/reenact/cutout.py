"""The person in the still, cut out: the matte, its edges, and warping picture and matte together."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.reenact.placement import Box
from relit_camera.reenact.warp import Warp, sampled
from relit_camera.space.images import LinearImage, Mask
from relit_camera.subject.subject import Subject

ENLARGE = 2
"""The still is enlarged by bicubic interpolation before the bilinear warp: as sharp as a bicubic one, and quicker."""
FEATHER = 0.06
"""Share of the still's width over which a person who is cut off by its side fades out."""


class Cutout:
    """One subject's person.

    Attributes:
        alpha: (height, width) float32 straight alpha of the still, faded out at the sides and the top.
        whole: whether there is background beside the head; else the picture's border cuts the face off.
    """

    def __init__(self, subject: Subject) -> None:
        self.alpha = feathered(subject.matte)
        self.whole = seen_whole(subject.matte)
        # Frames that were taken over black carry the matte as a factor already: twice would darken the edge.
        share = feathered(np.ones_like(self.alpha)) if subject.metadata.over_black else self.alpha
        self._share = share[..., None]
        self._large_alpha = _enlarged(self.alpha)

    def positions(self, warp: Warp, box: Box) -> NDArray[np.float32]:
        """Where the output pixels of `box` look under `warp`: (height, width, 2), for `sampled`."""
        return warp.map(box, ENLARGE)

    def sampled(self, relit: LinearImage, positions: NDArray[np.float32]) -> tuple[LinearImage, Mask]:
        """The relit still (height, width, 3) at `positions`: premultiplied, and alpha."""
        # Colours and alpha go apart through the same positions: taking four channels apart afterwards costs more.
        # The lower edge goes on below, where shoulders are cut off; the others are feathered to nothing.
        picture = sampled(_enlarged(relit * self._share), positions, cv2.BORDER_REPLICATE)
        alpha = sampled(self._large_alpha, positions, cv2.BORDER_REPLICATE)
        return picture, np.minimum(alpha, np.float32(1))


def seen_whole(matte: Mask) -> bool:
    """Whether there is background beside the head; else the picture's border cuts the face off."""
    return bool(matte[: len(matte) // 2, [0, -1]].mean() < 0.5)


def feathered(matte: Mask) -> Mask:
    """The matte, faded out toward the sides and the top of the picture where it would be cut off hard."""
    height, width = matte.shape
    reach = max(FEATHER * width, 1.0)
    across = np.clip((np.minimum(np.arange(width), np.arange(width)[::-1]) + 0.5) / reach, 0, 1)
    down = np.clip((np.arange(height) + 0.5) / reach, 0, 1)
    smooth = np.minimum.outer(down, across)
    return np.asarray(matte * (smooth * smooth * (3 - 2 * smooth)), dtype=np.float32)


def _enlarged(still: NDArray[np.float32]) -> NDArray[np.float32]:
    """The still (height, width[, channels]) at ENLARGE times its size, without bicubic's overshoot below 0."""
    large = cv2.resize(still, None, fx=ENLARGE, fy=ENLARGE, interpolation=cv2.INTER_CUBIC)
    return np.asarray(np.maximum(large, 0, out=large), dtype=np.float32)
