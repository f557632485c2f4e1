"""The last stop before the sink: the moved picture before its background, as the display shows it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relit_camera.compose.background import Backdrop, Wanted, needs_room
from relit_camera.compose.composite import foreground_colours, over, straight
from relit_camera.compose.live_room import LiveRoom
from relit_camera.compose.mattes import Matte
from relit_camera.reenact.reenactor import Moved
from relit_camera.space.display import display_from_linear
from relit_camera.space.images import DisplayImage, Frame, LinearImage
from relit_camera.stream.scene import Scene
from relit_camera.stream.timing import StageTimer


class Composer:
    """Composes pictures of one size. Not thread-safe."""

    def __init__(self, size: tuple[int, int], open_matte: Callable[[], Matte], timer: StageTimer) -> None:
        """`size` is (width, height); `open_matte` is called when a live person must first be parted from the room."""
        self._backdrop = Backdrop(size)
        self._matte: Matte | None = None
        self._open_matte = open_matte
        self._timer = timer

    def still(self, moved: Moved, scene: Scene, now: float) -> DisplayImage:
        """The reenacted still before its background: uint8 sRGB of the output's size. No live pixel is in it.

        `now` is the frame's time in seconds, for fading from one background to the next.
        """
        return still_before(self._backdrop, moved, scene, now)

    def live(self, picture: LinearImage, frame: Frame, scene: Scene) -> DisplayImage:
        """The relit live picture (output size, linear, display exposure) before its background, uint8 sRGB.

        Raises:
            ModelError: the background must be parted from the person and the matting model is missing.
        """
        shown = display_from_linear(picture)
        if not needs_room(scene.look.background, scene.look.lighting):
            return shown
        with self._timer.stage("matte"):
            if self._matte is None:
                self._matte = self._open_matte()
            alpha = self._matte.matte(frame)
        background = self._backdrop.live(_wanted(scene), LiveRoom(shown, alpha), frame.time_s)
        return over(foreground_colours(shown, alpha), alpha, np.ascontiguousarray(background))


def still_before(backdrop: Backdrop, moved: Moved, scene: Scene, now: float) -> DisplayImage:
    """A moved still before the scene's background at `now` seconds: uint8 sRGB of the backdrop's size."""
    background = backdrop.still(_wanted(scene), now)
    return over(display_from_linear(straight(moved.picture, moved.alpha)), moved.alpha, background, moved.at)


def _wanted(scene: Scene) -> Wanted:
    return Wanted(scene.look.background, scene.look.lighting, scene.environment, scene.backdrop)
