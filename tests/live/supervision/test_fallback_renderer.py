"""The picture in place of a live one: it follows light and head, and nobody waits while its relighter is opened."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from relit_camera.base.config.look import Lamp, Lighting, Look, Mode
from relit_camera.base.config.settings import Fallback
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.mode import RenderedFrame
from relit_camera.live.publishing.placeholder_image import Placeholder
from relit_camera.live.scene.scene import Scene
from relit_camera.live.supervision import fallback_renderer
from relit_camera.live.supervision.fallback_renderer import HOLD_S, KEPT_S, FallbackRenderer
from tests.live.people import LIVE_SIZE, live_frame, motion, person

FAILED = np.full((LIVE_SIZE[1], LIVE_SIZE[0], 3), 7, np.uint8)


class Opener:
    """Opens when it is told."""

    def __init__(self) -> None:
        self.asked: list[tuple[Callable[[], Any], Future[Any]]] = []

    def __call__(self, work: Callable[[], Any]) -> Future[Any]:
        future: Future[Any] = Future()
        self.asked.append((work, future))
        return future

    def open(self) -> None:
        work, future = self.asked[-1]
        future.set_result(work())


def at_once(work: Callable[[], Any]) -> Future[Any]:
    opener = Opener()
    future = opener(work)
    opener.open()
    return future


def renderer(
    start: Callable[[Callable[[], Any]], Future[Any]] = at_once, instead: Fallback = Fallback.PLACEHOLDER
) -> FallbackRenderer:
    return FallbackRenderer(LIVE_SIZE, instead, Placeholder(lambda: FAILED), start)


def made(scene: Scene, motion: FaceMotion | None = None, other_person: bool = False) -> RenderedFrame:
    """A picture that the pipeline has made."""
    return RenderedFrame(np.zeros((*LIVE_SIZE[::-1], 3), np.uint8), motion, scene, other_person=other_person)


def lit_from(azimuth_deg: float) -> Scene:
    lighting = Lighting(environment=None, lamps=[Lamp(azimuth_deg=azimuth_deg)], transition_s=0)
    return Scene(Look(lighting=lighting, mode=Mode.PORTRAIT), subject=person())


def shown(fallback: FallbackRenderer, frame: Frame, scene: Scene) -> DisplayImage:
    picture = fallback.picture(frame, scene)
    assert picture is not None
    assert not picture.unlit
    return picture.image


def middle(image: DisplayImage) -> float:
    """Column of the person's middle: where the picture differs from its border."""
    weight = np.abs(image.astype(float) - image[0, 0]).sum(axis=(0, 2))
    return float((weight * np.arange(len(weight))).sum() / weight.sum())


def test_it_follows_the_light() -> None:
    fallback = renderer()
    left, right = (shown(fallback, live_frame(index=index), lit_from(side)) for index, side in enumerate((-90, 90)))
    assert np.abs(left.astype(int) - right).mean() > 2


def test_it_moves_aside_as_the_head_did_when_it_was_last_tracked_and_does_since() -> None:
    fallback, scene = renderer(), lit_from(0)
    live = live_frame()
    at_rest = middle(shown(fallback, live, scene))
    fallback.note_live(live, made(scene, motion(shift=(4, 0, 0))))
    aside = middle(shown(fallback, live, scene))
    assert aside > at_rest + 5
    moved = Frame(np.roll(live.image, 6, axis=1), 1, live.captured_at + 0.03, live.time_s + 0.03)
    assert middle(shown(fallback, moved, scene)) > aside + 2


def test_nobody_waits_while_it_is_opened() -> None:
    opener = Opener()
    fallback, scene = renderer(opener), lit_from(0)
    assert fallback.picture(live_frame(index=0), scene) is None
    assert fallback.picture(live_frame(index=1), scene) is None
    assert len(opener.asked) == 1
    opener.open()
    assert fallback.picture(live_frame(index=2), scene) is not None


def test_it_is_kept_for_some_seconds_after_its_last_use() -> None:
    opener = Opener()
    fallback, scene = renderer(opener), lit_from(0)
    fallback.picture(live_frame(index=0), scene)
    opener.open()
    fallback.picture(live_frame(index=0), scene)
    fallback.release(KEPT_S - 0.1)
    assert fallback.picture(live_frame(index=0), scene) is not None
    fallback.release(KEPT_S + 0.1)
    assert fallback.picture(live_frame(index=0), scene) is None
    assert len(opener.asked) == 2


def test_where_it_cannot_be_opened_the_placeholder_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(fallback_renderer, "shared_relighter", fail)

    def start(work: Callable[[], Any]) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            work()
        except ZeroDivisionError as error:
            future.set_exception(error)
        return future

    fallback, scene = renderer(start), lit_from(0)
    assert fallback.picture(at(0.0), scene) is None
    np.testing.assert_array_equal(shown(fallback, at(HOLD_S + 0.1), scene), FAILED)


def at(captured_at: float) -> Frame:
    return replace(live_frame(), captured_at=captured_at)


@pytest.mark.parametrize(
    ("instead", "allowed", "filmed"),
    [(Fallback.PLACEHOLDER, True, False), (Fallback.FILMED, False, False), (Fallback.FILMED, True, True)],
)
def test_a_live_picture_is_held_and_nothing_of_the_source_image_appears(
    instead: Fallback, allowed: bool, filmed: bool
) -> None:
    def never(_: Callable[[], Any]) -> Future[Any]:
        raise AssertionError("the source image is not to be relit")

    fallback = renderer(never, instead)
    scene = Scene(Look(mode=Mode.LIVE), subject=person(), unlit_allowed=allowed)
    fallback.note_live(at(0.0), made(scene))
    assert fallback.picture(at(2.0), scene) is None
    assert fallback.picture(at(2.0 + HOLD_S - 0.1), scene) is None
    picture = fallback.picture(at(2.0 + HOLD_S), scene)
    assert picture is not None
    assert picture.unlit is filmed
    np.testing.assert_array_equal(picture.image, live_frame().image if filmed else FAILED)
    fallback.note_live(at(20.0), made(scene))
    assert fallback.picture(at(21.0), scene) is None, "it begins anew after a picture"


@pytest.mark.parametrize("mode", list(Mode))
def test_somebody_who_was_known_to_be_another_moves_no_portrait(mode: Mode) -> None:
    """The source image would follow their head: whatever mode the last picture was of, unless it is allowed by now."""
    fallback, scene = renderer(), lit_from(0)
    last = replace(scene, look=scene.look.model_copy(update={"mode": mode}))
    fallback.note_live(at(0.0), made(last, motion(shift=(4, 0, 0)), other_person=True))
    np.testing.assert_array_equal(shown(fallback, at(0.1), scene), FAILED)
    assert (shown(fallback, at(0.2), replace(scene, avatar_allowed=True)) != FAILED).any()
    another = replace(scene, subject=replace(person()))
    assert (shown(fallback, at(0.3), another) != FAILED).any(), "nothing is known of another subject"
    fallback.forget()
    np.testing.assert_array_equal(shown(fallback, at(0.4), scene), FAILED)
    fallback.note_live(at(0.5), made(scene))
    assert (shown(fallback, at(0.6), scene) != FAILED).any()


def test_nothing_of_another_mode_is_held() -> None:
    """Who turns to portrait while pictures fail is hidden at once."""
    live = Scene(Look(mode=Mode.LIVE), subject=person())
    fallback = renderer(Opener())
    fallback.note_live(at(0.0), made(live))
    np.testing.assert_array_equal(shown(fallback, at(0.1), lit_from(0)), FAILED)
