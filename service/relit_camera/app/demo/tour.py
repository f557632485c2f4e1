"""A round trip through places: what is shown at each moment, and the guide that shows it until somebody else does."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from relit_camera.base.config.look import (
    ColorBackground,
    EnvironmentBackground,
    Lamp,
    Lighting,
    Look,
    Mode,
    NoBackground,
)
from relit_camera.base.easing import interpolate_keyframes
from relit_camera.live.scene.scene import Scene
from relit_camera.live.scene.scene_controller import SceneController

TICK_S = 0.05
CAPTION_INTERVAL_S = 1.0
"""A caption is told again, for who has begun to look since."""
STOP_TIMEOUT_S = 1.0


@dataclass(frozen=True)
class TourStop:
    """One place of the tour.

    Attributes:
        caption: what the viewer reads.
        seconds: how long it is shown.
        look: what is shown at a share 0..1 of that time.
    """

    caption: str
    seconds: float
    look: Callable[[float], Look]


def tour_at(time_s: float) -> tuple[TourStop, Look]:
    """The stop, and the look that is shown at a time; after the last stop it begins again."""
    within = time_s % sum(stop.seconds for stop in TOUR_STOPS)
    for stop in TOUR_STOPS:
        if within < stop.seconds:
            return stop, stop.look(within / stop.seconds)
        within -= stop.seconds
    return TOUR_STOPS[0], TOUR_STOPS[0].look(0.0)


class DemoRunner:
    """Leads a camera through the tour, until it is stopped or somebody else changes the scene."""

    def __init__(
        self, scene_controller: SceneController, ready: Callable[[], bool], on_caption: Callable[[str], None]
    ) -> None:
        """`ready` says when to begin; `on_caption` hears the caption each second, and "" when the tour is over."""
        self._scene_controller, self._ready, self._on_caption = scene_controller, ready, on_caption
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="tour", daemon=True)

    def start(self) -> None:
        """Begin the tour."""
        self._thread.start()

    def stop(self) -> None:
        """End it; harmless when repeated, or before it has begun."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join(STOP_TIMEOUT_S)

    def _run(self) -> None:
        shown = self._scene_controller.scene
        while not self._ready():
            if self._stopping.wait(TICK_S):
                return
        began, told, tell_at = time.monotonic(), "", 0.0
        try:
            while not self._stopping.wait(TICK_S):
                now = time.monotonic()
                stop, look = tour_at(now - began)
                if stop.caption != told or now >= tell_at:
                    told, tell_at = stop.caption, now + CAPTION_INTERVAL_S
                    self._on_caption(told)
                shown = self._show(look, shown)
        except _TakenOverError:
            self._scene_controller.update_look(lambda look: _without_split(look, shown.look.lighting.split))
        finally:
            self._on_caption("")

    def _show(self, look: Look, shown: Scene) -> Scene:
        """Show the look, if what the tour has `shown` still stands."""

        def unless_changed(_: Look) -> Look:
            if self._scene_controller.scene is not shown:
                raise _TakenOverError
            return look

        if look == shown.look and self._scene_controller.scene is shown:
            return shown  # every page hears of each change
        return self._scene_controller.update_look(unless_changed, recorded=False)


class _TakenOverError(Exception):
    """Somebody else has changed the scene."""


def _without_split(look: Look, left_split: float) -> Look:
    """The look without the tour's own before and after, behind which a change would not be seen."""
    if look.lighting.split != left_split:
        return look
    return look.model_copy(update={"lighting": look.lighting.model_copy(update={"split": 0.0})})


def _in_environment(environment: str, yaw_deg: float = 0.0, split: float = 0.0) -> Look:
    """The person in an environment, before that same place."""
    light = Lighting(environment=environment, yaw_deg=yaw_deg, split=split)
    return Look(mode=Mode.LIVE, lighting=light, background=EnvironmentBackground())


def _as_filmed(_: float) -> Look:
    return Look(mode=Mode.LIVE, lighting=Lighting(environment="sunset", split=1.0), background=NoBackground())


def _split_wipe(share: float) -> Look:
    """From the live picture to the relit one, left after right, and once back and forth so that both are seen."""
    keys = ((0.0, 1.0), (0.3, 0.0), (0.55, 0.0), (0.7, 0.5), (0.85, 0.5), (1.0, 0.0))
    return _in_environment("sunset", split=interpolate_keyframes(share, keys))


def _rotating_light(share: float) -> Look:
    """The light of the studio led once round the head; the place behind turns with it."""
    return _in_environment(
        "studio", yaw_deg=interpolate_keyframes(share, ((0.0, 0.0), (0.15, 0.0), (0.9, -360.0), (1.0, -360.0)))
    )


def _moving_lamps(share: float) -> Look:
    """A warm lamp that is moved across, and a cold one that stays behind."""
    azimuth = interpolate_keyframes(share, ((0.0, -100.0), (0.45, 80.0), (0.6, 80.0), (1.0, -100.0)))
    lamps = (
        Lamp(azimuth_deg=azimuth, elevation_deg=22, size_deg=24, kelvin=3000, intensity=1.0),
        Lamp(azimuth_deg=150, elevation_deg=20, size_deg=30, kelvin=12000, intensity=2.0),
    )
    return Look(
        mode=Mode.LIVE,
        lighting=Lighting(environment=None, lamps=lamps, transition_s=0.2),
        background=ColorBackground(color="#101216"),
    )


TOUR_STOPS = (
    TourStop("As filmed. Touch anything, and the camera is yours", 4.0, _as_filmed),
    TourStop("Relit: sunset", 7.0, _split_wipe),
    TourStop("A studio, its lights led round", 8.0, _rotating_light),
    TourStop("A street at night", 4.0, lambda _: _in_environment("night-street")),
    TourStop("Two lamps in the dark", 7.0, _moving_lamps),
    TourStop("A party", 4.0, lambda _: _in_environment("party")),
    TourStop("Outdoors, overcast", 4.0, lambda _: _in_environment("overcast")),
    TourStop(
        "By the window",
        4.0,
        lambda share: _in_environment("window", split=interpolate_keyframes(share, ((0, 0), (0.6, 0), (1, 1)))),
    ),
)
