"""The subject at rest: the relit source image as it lies in the output while there is no face to follow."""

from __future__ import annotations

from relit_camera.base.images.image_types import LinearImage
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.reenactment.source_image import Cutout
from relit_camera.live.reenactment.warp import Warp, source_from_output, visible_box
from relit_camera.subject.subject import Subject


class RestLayer:
    """Places one subject's relit source image, unmoved, in an output of one size."""

    def __init__(self, subject: Subject, size: tuple[int, int]) -> None:
        """`size` is (width, height) of the output."""
        self._person = Cutout(subject)
        placed = source_from_output(subject.size, size)
        self._box = visible_box(placed, subject.size, size)
        self._grid = Warp(placed, ()).grid(self._box)

    def render(self, relit: LinearImage) -> WarpedLayer:
        """The layer of a relit picture of the subject's size, float32 linear in display exposure."""
        return WarpedLayer(self._person.warped(self._person.image(relit), self._grid), self._box[:2])
