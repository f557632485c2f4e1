"""Whether something in the picture mirrors the lamp, wherever the lamp is."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.capture.ball.highlight import Highlight, brightest_place
from relit_camera.capture.ball.outline import Outline
from relit_camera.capture.ball.sample import SceneSample
from relit_camera.capture.ball.view import DistantView

_MAX_SIDE = 480
_STILL_SHARE = 0.2
_BRIGHT = 0.5
"""The mirror image of a lamp is far brighter than anything that it lights."""
_INNER = 0.9
"""Radii: there a mirror ball shows what is 128 degrees off the camera. No lamp that lights a face is farther."""
_FEW = 5
"""So few pictures do not tell what is there without the lamp."""


class Glints:
    """Small bright places that a scene shows in some of its pictures and not in others."""

    def __init__(self, sample: SceneSample) -> None:
        """Take the scene as it is in its darker pictures, pixel by pixel, for what is there without the lamp."""
        shape = sample.codes.shape[1:]
        self._factor = min(1.0, _MAX_SIDE / max(shape))
        size = (max(1, round(shape[1] * self._factor)), max(1, round(shape[0] * self._factor)))
        self._lights = np.stack(
            [
                cv2.resize(sample.luminance(index), size, interpolation=cv2.INTER_AREA)
                for index in range(len(sample.codes))
            ]
        )
        enough = len(self._lights) >= _FEW
        self._dark = np.quantile(self._lights, _STILL_SHARE, axis=0).astype(np.float32) if enough else None

    def share(self, circle: Outline) -> float:
        """Share of the pictures in which one small place in this circle is bright by the lamp.

        Args:
            circle: in pixels of the sample.
        """
        small = circle.scaled(self._factor)
        view = DistantView(small)
        found = (brightest_place(light, view, self._dark) for light in self._lights)
        glints = [place for place in found if isinstance(place, Highlight) and place.brightness > _BRIGHT]
        inner = [place for place in glints if np.hypot(place.x - small.x, place.y - small.y) < _INNER * small.radius]
        return len(inner) / len(self._lights)
