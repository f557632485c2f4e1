"""A round trip through places: what is shown at each moment, and the guide that shows it until somebody else does."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from relit_camera.config.look import (
    ColorBackground,
    EnvironmentBackground,
    Lamp,
    Lighting,
    Look,
    Mode,
    NoBackground,
)
from relit_camera.space.easing import eased_value
from relit_camera.stream.director import Director
from relit_camera.stream.scene import Scene

TICK_S = 0.05
TELL_EVERY_S = 1.0
"""A caption is told again, for who has begun to look since."""
STOP_S = 1.0


@dataclass(frozen=True)
class Stop:
    """One place of the tour.

    Attributes:
        caption: what the viewer reads.
        seconds: how long it is shown.
        look: what is shown at a share 0..1 of that time.
    """

    caption: str
    seconds: float
    look: Callable[[float], Look]


def tour_at(time_s: float) -> tuple[Stop, Look]:
    """The stop, and the look that is shown at a time; after the last stop it begins again."""
    within = time_s % sum(stop.seconds for stop in STOPS)
    for stop in STOPS:
        if within < stop.seconds:
            return stop, stop.look(within / stop.seconds)
        within -= stop.seconds
    return STOPS[0], STOPS[0].look(0.0)


class Guide:
    """Leads a camera through the tour, until it is stopped or somebody else changes the scene."""

    def __init__(self, director: Director, ready: Callable[[], bool], tell: Callable[[str], None]) -> None:
        """`ready` says when to begin; `tell` hears the caption each second, and "" when the tour is over."""
        self._director, self._ready, self._tell = director, ready, tell
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._lead, name="tour", daemon=True)

    def start(self) -> None:
        """Begin the tour."""
        self._thread.start()

    def stop(self) -> None:
        """End it; harmless when repeated, or before it has begun."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join(STOP_S)

    def _lead(self) -> None:
        shown = self._director.scene
        while not self._ready():
            if self._stopping.wait(TICK_S):
                return
        began, told, tell_at = time.monotonic(), "", 0.0
        try:
            while not self._stopping.wait(TICK_S):
                now = time.monotonic()
                stop, look = tour_at(now - began)
                if stop.caption != told or now >= tell_at:
                    told, tell_at = stop.caption, now + TELL_EVERY_S
                    self._tell(told)
                shown = self._show(look, shown)
        except _TakenOverError:
            self._director.update_look(lambda look: _whole(look, shown.look.lighting.split))
        finally:
            self._tell("")

    def _show(self, look: Look, shown: Scene) -> Scene:
        """Show the look, if what the tour has `shown` still stands."""

        def unless_changed(_: Look) -> Look:
            if self._director.scene is not shown:
                raise _TakenOverError
            return look

        if look == shown.look and self._director.scene is shown:
            return shown  # every page hears of each change
        return self._director.update_look(unless_changed)


class _TakenOverError(Exception):
    """Somebody else has changed the scene."""


def _whole(look: Look, left_split: float) -> Look:
    """The look without the tour's own before and after, behind which a change would not be seen."""
    if look.lighting.split != left_split:
        return look
    return look.model_copy(update={"lighting": look.lighting.model_copy(update={"split": 0.0})})


def _place(environment: str, yaw_deg: float = 0.0, split: float = 0.0) -> Look:
    """The person in an environment, before that same place."""
    light = Lighting(environment=environment, yaw_deg=yaw_deg, split=split)
    return Look(mode=Mode.RATIO, lighting=light, background=EnvironmentBackground())


def _as_filmed(_: float) -> Look:
    return Look(mode=Mode.RATIO, lighting=Lighting(environment="sunset", split=1.0), background=NoBackground())


def _wiped(share: float) -> Look:
    """From the live picture to the relit one, left after right, and once back and forth so that both are seen."""
    keys = ((0.0, 1.0), (0.3, 0.0), (0.55, 0.0), (0.7, 0.5), (0.85, 0.5), (1.0, 0.0))
    return _place("sunset", split=eased_value(share, keys))


def _turned(share: float) -> Look:
    """The light of the studio led once round the head; the place behind turns with it."""
    return _place("studio", yaw_deg=eased_value(share, ((0.0, 0.0), (0.15, 0.0), (0.9, -360.0), (1.0, -360.0))))


def _lamps(share: float) -> Look:
    """A warm lamp that is moved across, and a cold one that stays behind."""
    azimuth = eased_value(share, ((0.0, -100.0), (0.45, 80.0), (0.6, 80.0), (1.0, -100.0)))
    lamps = (
        Lamp(azimuth_deg=azimuth, elevation_deg=22, size_deg=24, kelvin=3000, intensity=1.0),
        Lamp(azimuth_deg=150, elevation_deg=20, size_deg=30, kelvin=12000, intensity=2.0),
    )
    return Look(
        mode=Mode.RATIO,
        lighting=Lighting(environment=None, lamps=lamps, transition_s=0.2),
        background=ColorBackground(color="#101216"),
    )


STOPS = (
    Stop("As filmed. Touch anything, and the camera is yours", 4.0, _as_filmed),
    Stop("Relit: sunset", 7.0, _wiped),
    Stop("A studio, its lights led round", 8.0, _turned),
    Stop("A street at night", 4.0, lambda _: _place("night-street")),
    Stop("Two lamps in the dark", 7.0, _lamps),
    Stop("A party", 4.0, lambda _: _place("party")),
    Stop("Outdoors, overcast", 4.0, lambda _: _place("overcast")),
    Stop("By the window", 4.0, lambda share: _place("window", split=eased_value(share, ((0, 0), (0.6, 0), (1, 1))))),
)
