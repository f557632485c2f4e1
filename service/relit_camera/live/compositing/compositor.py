"""Putting the person before the background: the finished picture, as the display shows it."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.config.look import BlurBackground, NoBackground
from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_types import Alpha, Box, DisplayImage, Frame
from relit_camera.face.matting import Matting
from relit_camera.live.compositing.alpha_compositing import NEIGHBORHOOD, over, replace_room, split_alpha
from relit_camera.live.compositing.background_renderer import (
    BackgroundRenderer,
    BackgroundRequest,
)
from relit_camera.live.compositing.matted_frame import MattedFrame
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.status.stage_timing import StageTimer

MATTE_KEPT_S = 0.1
"""A matte is not used again for a later frame than this."""
SURELY_PERSON = 0.8
"""Confidence of the source image above which a cell is the person's, whatever the matte says."""


class Compositor:
    """Composes pictures of one size. `composite_*` are for one thread."""

    def __init__(
        self,
        size: tuple[int, int],
        open_matte: Callable[[], Matting],
        timer: StageTimer,
        troubles: dict[str, Degradation],
    ) -> None:
        """Set up.

        Args:
            size: (width, height).
            open_matte: called when a live person must first be parted from the room.
            timer: counts the stages.
            troubles: where what works less well than asked is noted, under `matte`.
        """
        self._background_renderer = BackgroundRenderer(size)
        self._matte: Matting | None = None
        self._last_matte: tuple[Alpha, float] | None = None
        self._matte_age = 0
        self._troubles = troubles
        self._open_matte = open_matte
        self._timer = timer

    def composite_source(self, layer: WarpedLayer, scene: Scene, now: float) -> DisplayImage:
        """The warped source image before its background: uint8 sRGB of the output's size. No live pixel is in it.

        `now` is the frame's time in seconds, for fading from one background to the next.
        """
        return composite_source_image(self._background_renderer, layer, scene, now)

    def person_alpha(
        self, frame: Frame, scene: Scene, person: NDArray[np.float32] | None = None, matte_every: int = 1
    ) -> Alpha | None:
        """Alpha of the people in a live frame of the output's size; None where they are not parted from the room.

        That is before a kept room, if the matting model is missing or sees nobody where somebody is.

        Args:
            frame: the live frame.
            scene: what to show.
            person: (rows, columns) float32, how surely cells of the frame show the person, 0..1: the matte leaves out
                nothing that is sure.
            matte_every: before a kept room, in so many frames the person is parted from it anew.

        Raises:
            ModelError: another background needs the matting model, and it is missing.
        """
        kept = isinstance(scene.look.background, NoBackground)
        with self._timer.stage("matte"):
            matte = self._person_matte(frame, required=not kept, every=matte_every if kept else 1)
        if matte is None or person is None:
            return matte
        if kept and not matte.any():
            return None  # better the room is relit than somebody who is there is not
        return np.maximum(matte, _sure_alpha(person, frame.size))

    def needed(self, alpha: Alpha, scene: Scene) -> Box:
        """Left, top, right and bottom of what `composite_live` looks at of a picture of people with this alpha.

        Before another background that is more than they fill: it is told from what is near what shines through.
        """
        left, top, width, height = cv2.boundingRect(alpha)
        rows, columns = alpha.shape
        more = 0 if isinstance(scene.look.background, NoBackground) else math.ceil(NEIGHBORHOOD * rows)
        return (
            max(left - more, 0),
            max(top - more, 0),
            min(left + width + more, columns),
            min(top + height + more, rows),
        )

    def composite_live(self, picture: DisplayImage, alpha: Alpha | None, frame: Frame, scene: Scene) -> DisplayImage:
        """The people of a live picture before the scene's background; both are of the output's size.

        A room that is kept or blurred is that of the frame, as filmed.

        Args:
            picture: in which the people are lit as they shall be.
            alpha: of them, see `person_alpha`; where it is None the picture stays as it is.
            frame: the live frame.
            scene: what to show.
        """
        if alpha is None:
            return picture
        request = _background_request(scene)
        background = self._background_renderer.live_background(request, MattedFrame(frame.image, alpha), frame.time_s)
        if isinstance(scene.look.background, NoBackground):
            return over(picture, alpha, background)
        # A blurred room is this frame's own.
        return replace_room(
            MattedFrame(picture, alpha), background, in_place=isinstance(scene.look.background, BlurBackground)
        )

    def _person_matte(self, frame: Frame, required: bool, every: int) -> Alpha | None:
        """The matte of the person in a frame; None where its model is missing, unless it is required.

        Or that of the last frame again, but for one of `every` frames.
        """
        last, self._matte_age = self._last_matte, self._matte_age + 1
        if last is not None and self._matte_age < every and 0 < frame.time_s - last[1] < MATTE_KEPT_S:
            return last[0]
        if self._matte is None and (required or "matte" not in self._troubles):
            try:
                self._matte = self._open_matte()
            except ModelError as error:
                if required:
                    raise
                what = "the room is lit as the person is"
                code = DegradationCode.ROOM_NOT_PARTED
                self._troubles["matte"] = Degradation(what, error.what, error.cure, code=code)
            else:
                self._troubles.pop("matte", None)
        if self._matte is None:
            return None
        self._last_matte, self._matte_age = (self._matte.matte(frame), frame.time_s), 0
        return self._last_matte[0]


def _sure_alpha(person: NDArray[np.float32], size: tuple[int, int]) -> Alpha:
    """Alpha of `size` (width, height) for what cells surely show of the person."""
    sure = np.clip((person - SURELY_PERSON) / (1 - SURELY_PERSON), 0, 1)
    step = -(-size[0] // person.shape[1])  # the last cells may go beyond the picture
    whole = (step * person.shape[1], step * person.shape[0])
    alpha = cv2.resize((255 * sure).astype(np.uint8), whole, interpolation=cv2.INTER_LINEAR)
    return np.asarray(alpha[: size[1], : size[0]], np.uint8)


def composite_source_image(
    background_renderer: BackgroundRenderer, layer: WarpedLayer, scene: Scene, now: float
) -> DisplayImage:
    """A warped source image before the scene's background at `now` seconds: uint8 sRGB of the renderer's size."""
    background = background_renderer.static_background(_background_request(scene), now)
    return over(*split_alpha(layer.image), background, layer.at)


def _background_request(scene: Scene) -> BackgroundRequest:
    return BackgroundRequest(scene.look.background, scene.look.lighting, scene.environment, scene.background_image)
