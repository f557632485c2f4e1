"""What is one step, and what can be undone."""

from __future__ import annotations

import pytest

from relit_camera.base.config.look import Lighting, Look, Mode
from relit_camera.base.errors import NotFoundError
from relit_camera.live.scene.scene_history import MAX_STEPS, SAME_STEP_S, SceneHistory, ScenePoint, changed_fields
from tests.virtual_clock import VirtualClock


def point(mode: Mode = Mode.PORTRAIT, subject: str | None = None, **lighting: float) -> ScenePoint:
    return ScenePoint(Look(lighting=Lighting.model_validate(lighting), mode=mode), subject, False, False)


def steps(history: SceneHistory, now: ScenePoint) -> list[ScenePoint]:
    """All points that undoing leads to."""
    found = []
    while (before := history.undo(now, lambda point: point)) is not None:
        found.append(before)
        now = before
    return found


def test_a_slider_is_one_step_until_it_rests() -> None:
    clock = VirtualClock()
    history, now = SceneHistory(clock), point()
    for yaw in range(1, 10):
        clock.sleep(SAME_STEP_S / 2)
        then, now = now, point(yaw_deg=yaw)
        history.note(then, now)
    clock.sleep(SAME_STEP_S)
    history.note(now, point(yaw_deg=50))
    assert [step.look.lighting.yaw_deg for step in steps(history, point(yaw_deg=50))] == [9, 0]


def test_other_fields_are_another_step() -> None:
    history = SceneHistory(VirtualClock())
    history.note(point(), point(yaw_deg=1))
    history.note(point(yaw_deg=1), point(mode=Mode.LIVE, yaw_deg=1))
    assert steps(history, point(mode=Mode.LIVE, yaw_deg=1)) == [point(yaw_deg=1), point()]


def test_what_changes_nothing_is_no_step_and_keeps_what_was_undone() -> None:
    history = SceneHistory(VirtualClock())
    history.note(point(), point(yaw_deg=1))
    assert history.undo(point(yaw_deg=1), lambda before: before) == point()
    history.note(point(), point())
    assert (history.can_undo, history.can_redo) == (False, True)
    history.note(point(), point(subject="ada"))
    assert not history.can_redo


def test_a_change_after_redo_is_a_step_of_its_own() -> None:
    history = SceneHistory(VirtualClock())
    history.note(point(), point(yaw_deg=1))
    history.undo(point(yaw_deg=1), lambda before: before)
    assert history.redo(point(), lambda after: after) == point(yaw_deg=1)
    history.note(point(yaw_deg=1), point(yaw_deg=2))
    assert steps(history, point(yaw_deg=2)) == [point(yaw_deg=1), point()]


def test_a_step_that_cannot_be_restored_is_dropped() -> None:
    def fail(before: ScenePoint) -> ScenePoint:
        raise NotFoundError("it is deleted")

    history = SceneHistory(VirtualClock())
    history.note(point(), point(yaw_deg=1))
    with pytest.raises(NotFoundError):
        history.undo(point(yaw_deg=1), fail)
    assert (history.can_undo, history.can_redo) == (False, False)


def test_old_steps_are_forgotten() -> None:
    clock = VirtualClock()
    history = SceneHistory(clock)
    for exposure in range(MAX_STEPS + 10):
        clock.sleep(2 * SAME_STEP_S)
        history.note(point(saturation=exposure % 2), point(saturation=(exposure + 1) % 2))
    assert len(steps(history, point())) == MAX_STEPS


def test_changed_fields_are_named() -> None:
    assert changed_fields(point(), point(Mode.LIVE, "ada", yaw_deg=1)) == {"mode", "subject", "lighting.yaw_deg"}
