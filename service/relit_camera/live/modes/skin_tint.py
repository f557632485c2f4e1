"""How a person's skin differs from that of the head that is nobody's (`capture.instant.anyone`), told by live frames.

With that head the room's light is estimated in the person's own color and brightness: what their skin takes from the
light counts as the room's. The relit picture is corrected by what their skin is taken for (`face.skin_prior`).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8, luminance
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.face.skin_prior import estimate_skin
from relit_camera.live.modes.source_masks import inside_face
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.subject.subject import Subject

INTERVAL_S, TIME_CONSTANT_S = 0.25, 2.0
"""Time between two looks, and over which they are averaged, in logarithms."""
LEAST_SAMPLES = 50
THUMBNAIL = (32, 18)
"""Size of the picture of which the mean luminance is taken."""


class SkinTint:
    """The factor by which a person's skin is brighter than that of one subject. Not thread-safe."""

    def __init__(self, subject: Subject, face: SourceFace) -> None:
        """`face` is that of the subject, which must keep its albedo."""
        assert subject.albedo is not None
        self._skin = np.median(subject.albedo[inside_face(face) > 0.9].astype(np.float32), axis=0)
        self._logarithm: NDArray[np.float64] | None = None
        self._looked_s = -np.inf

    def update(self, image: DisplayImage, skin: NDArray[np.float32], time_s: float) -> NDArray[np.float32]:
        """The factor (3,) after a live frame.

        Args:
            image: the whole frame, uint8 sRGB.
            skin: (count, 3) linear values of the face in it; few or none where it is hidden or overexposed.
            time_s: of the frame.
        """
        passed = time_s - self._looked_s
        if len(skin) >= LEAST_SAMPLES and not 0 <= passed < INTERVAL_S:
            small = np.asarray(cv2.resize(image, THUMBNAIL, interpolation=cv2.INTER_AREA), np.uint8)
            seen = estimate_skin(skin, float(luminance(linear_from_uint8(small)).mean()))
            found = np.log(seen / np.maximum(self._skin, 1e-3))
            share = 1.0 if self._logarithm is None or passed < 0 else 1 - np.exp(-passed / TIME_CONSTANT_S)
            before = found if self._logarithm is None else self._logarithm
            self._logarithm, self._looked_s = before + share * (found - before), time_s
        return np.ones(3, np.float32) if self._logarithm is None else np.exp(self._logarithm).astype(np.float32)
