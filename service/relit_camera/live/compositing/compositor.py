"""Putting the person before the background: the finished picture, as the display shows it."""

from __future__ import annotations

from collections.abc import Callable

from relit_camera.base.config.look import BlurBackground
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.matting import Matting
from relit_camera.live.compositing.alpha_compositing import over, replace_room, split_alpha
from relit_camera.live.compositing.background_renderer import (
    BackgroundRenderer,
    BackgroundRequest,
    needs_matte,
)
from relit_camera.live.compositing.matted_frame import MattedFrame
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer


class Compositor:
    """Composes pictures of one size. `composite_*` are for one thread."""

    def __init__(self, size: tuple[int, int], open_matte: Callable[[], Matting], timer: StageTimer) -> None:
        """`size` is (width, height); `open_matte` is called when a live person must first be parted from the room."""
        self._background_renderer = BackgroundRenderer(size)
        self._matte: Matting | None = None
        self._open_matte = open_matte
        self._timer = timer

    def composite_source(self, layer: WarpedLayer, scene: Scene, now: float) -> DisplayImage:
        """The warped source image before its background: uint8 sRGB of the output's size. No live pixel is in it.

        `now` is the frame's time in seconds, for fading from one background to the next.
        """
        return composite_source_image(self._background_renderer, layer, scene, now)

    def composite_live(self, picture: DisplayImage, frame: Frame, scene: Scene) -> DisplayImage:
        """The relit live picture of the output's size before its background; the same where the room stays as it is.

        Raises:
            ModelError: the background must be parted from the person and the matting model is missing.
        """
        if not needs_matte(scene.look.background, scene.look.lighting):
            return picture
        with self._timer.stage("matte"):
            if self._matte is None:
                self._matte = self._open_matte()
            matted = MattedFrame(picture, self._matte.matte(frame))
        background = self._background_renderer.live_background(_background_request(scene), matted, frame.time_s)
        # A blurred room is this frame's own.
        return replace_room(matted, background, in_place=isinstance(scene.look.background, BlurBackground))


def composite_source_image(
    background_renderer: BackgroundRenderer, layer: WarpedLayer, scene: Scene, now: float
) -> DisplayImage:
    """A warped source image before the scene's background at `now` seconds: uint8 sRGB of the renderer's size."""
    background = background_renderer.static_background(_background_request(scene), now)
    return over(*split_alpha(layer.image), background, layer.at)


def _background_request(scene: Scene) -> BackgroundRequest:
    return BackgroundRequest(scene.look.background, scene.look.lighting, scene.environment, scene.background_image)
