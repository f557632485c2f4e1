"""What is shown while the picture path fails or hangs."""

from __future__ import annotations

import logging

import numpy as np

from relit_camera.compose.background import Backdrop, cropped_to_fill
from relit_camera.config.settings import Fallback
from relit_camera.light.maps import LightMap
from relit_camera.reenact.cutout import Cutout
from relit_camera.reenact.placement import still_from_output, visible_box
from relit_camera.reenact.reenactor import Moved
from relit_camera.reenact.warp import Warp
from relit_camera.relight.basis import BasisRelighter
from relit_camera.space.images import DisplayImage, Frame
from relit_camera.stream.composer import still_before
from relit_camera.stream.lighting import EasedLight
from relit_camera.stream.scene import Scene
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)


class StandIn:
    """Makes pictures without tracker and reenactor: the subject's still at rest, relit as the scene says.

    Where there is no subject, or that fails too: the live picture or the placeholder, as configured. Not thread-safe.
    """

    def __init__(self, size: tuple[int, int], fallback: Fallback, placeholder: DisplayImage) -> None:
        """For an output of `size` (width, height).

        Args:
            size: of the pictures to make.
            fallback: what is shown where no still can be.
            placeholder: uint8 sRGB RGB of the output's size.
        """
        self._size, self._fallback, self._placeholder = size, fallback, placeholder
        self._backdrop = Backdrop(size)
        self._light = EasedLight()
        self._still: _Still | None = None
        self._spoiled: Subject | None = None

    def rest(self) -> None:
        """Let go of the memory that pictures take: none is wanted now."""
        self._still = None

    def picture(self, frame: Frame, scene: Scene) -> DisplayImage:
        """A picture for this live frame: uint8 sRGB RGB of the output's size. Never fails."""
        subject = scene.subject
        if subject is not None and subject is not self._spoiled:
            try:
                return self._relit(subject, scene, frame.time_s)
            except Exception:  # this is what is shown when all else fails
                log.exception("the still cannot be relit either")
                self._spoiled = subject
        return cropped_to_fill(frame.image, self._size) if self._fallback is Fallback.LIVE else self._placeholder

    def _relit(self, subject: Subject, scene: Scene, now: float) -> DisplayImage:
        if self._still is None or self._still.subject is not subject:
            self._still = _Still(subject, self._size)
        light = self._light.update(scene, now) * np.float32(subject.metadata.display_gain)
        return still_before(self._backdrop, self._still.lit(light), scene, now)


class _Still:
    """One subject, in its place in the output."""

    def __init__(self, subject: Subject, size: tuple[int, int]) -> None:
        self.subject = subject
        self._relighter = BasisRelighter(subject)
        self._person = Cutout(subject)
        placed = still_from_output(subject.size, size)
        self._box = visible_box(placed, subject.size, size)
        self._positions = self._person.positions(Warp(placed, ()), self._box)
        self._last: tuple[LightMap, Moved] | None = None

    def lit(self, light: LightMap) -> Moved:
        """The person under `light`; the last picture again while that stays."""
        if self._last is None or not np.array_equal(self._last[0], light):
            picture, alpha = self._person.sampled(self._relighter.relight(light), self._positions)
            self._last = light, Moved(picture, alpha, self._box[:2])
        return self._last[1]
