"""The picture that is shown while the pipeline fails or hangs."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from relit_camera.base.concurrency.resident_memory import large_allocations_apart, return_freed_memory
from relit_camera.base.config.settings import Fallback
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.light.light_map import LightMap
from relit_camera.live.compositing.background_renderer import BackgroundRenderer
from relit_camera.live.compositing.compositor import composite_source_image
from relit_camera.live.publishing.placeholder_image import Placeholder
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.reenactment.rest_layer import RestLayer
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.relighting.shared_relighters import shared_relighter
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FallbackPicture:
    """A picture in place of a live one.

    Attributes:
        image: uint8 sRGB RGB (height, width, 3), of the output's size.
        unlit: whether it is as filmed.
    """

    image: DisplayImage
    unlit: bool = False


class FallbackRenderer:
    """Renders without tracker and reenactor: the subject's source image at rest, relit as the scene says.

    Where there is no subject, or where that fails too, it gives the placeholder, or where both settings and scene allow
    it the live picture. Not thread-safe.
    """

    def __init__(self, size: tuple[int, int], fallback: Fallback, placeholder: Placeholder) -> None:
        """Set up; nothing is rendered yet.

        Args:
            size: (width, height) of the output in pixels.
            fallback: what is shown where the source image cannot be relit.
            placeholder: of the output's size.
        """
        self._size, self._fallback, self._placeholder = size, fallback, placeholder
        self._background_renderer = BackgroundRenderer(size)
        self._light = LightTransition()
        self._source: _RelitSource | None = None
        self._failed_subject: Subject | None = None

    def release(self) -> None:
        """Free the memory of the relit source image and its background, while no fallback is needed."""
        if self._source is not None:
            self._source = None
            self._background_renderer = BackgroundRenderer(self._size)
            return_freed_memory()

    def picture(self, frame: Frame, scene: Scene) -> FallbackPicture:
        """A picture in place of this live frame. Never raises. As filmed only where the scene allows that too."""
        subject = scene.subject
        if subject is not None and subject is not self._failed_subject:
            try:
                return FallbackPicture(self._relit(subject, scene, frame.time_s))
            except Exception:  # this is what is shown when all else fails
                log.exception("the source image cannot be relit either")
                self._failed_subject = subject
        if self._fallback is Fallback.LIVE and scene.unlit_allowed:
            return FallbackPicture(crop_to_fill(frame.image, self._size), unlit=True)
        return FallbackPicture(self._placeholder.image)

    def _relit(self, subject: Subject, scene: Scene, now: float) -> DisplayImage:
        if self._source is None or self._source.subject is not subject:
            with large_allocations_apart():
                self._source = _RelitSource(subject, self._size)
        light = self._light.update(scene, now) * np.float32(subject.metadata.display_gain)
        return composite_source_image(self._background_renderer, self._source.render(light), scene, now)


class _RelitSource:
    """The source image of one subject, placed in the output as it is at rest."""

    def __init__(self, subject: Subject, size: tuple[int, int]) -> None:
        self.subject = subject
        self._relighter = shared_relighter(subject)
        subject.drop_pages()
        self._at_rest = RestLayer(subject, size)
        self._last: tuple[LightMap, WarpedLayer] | None = None

    def render(self, light: LightMap) -> WarpedLayer:
        """The person under `light`; the previous layer again if the light has not changed."""
        if self._last is None or not np.array_equal(self._last[0], light):
            self._last = light, self._at_rest.render(self._relighter.relight(light[None])[0])
        return self._last[1]
