"""The steps of the scene that can be undone and done again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from relit_camera.base.concurrency.clock import Clock
from relit_camera.base.config.look import Look
from relit_camera.base.errors import RelitError

T = TypeVar("T")

MAX_STEPS = 200
"""Older steps are forgotten. A step is a look and a name: some kilobytes."""
SAME_STEP_S = 1.0
"""Changes of the same fields that follow each other within this are one step: a slider sends dozens a second."""


@dataclass(frozen=True)
class ScenePoint:
    """What of a scene can be brought back.

    Attributes:
        look: lighting, background and mode.
        subject_name: who is shown; None for nobody.
        unlit_allowed: whether the picture as filmed may be published.
        avatar_allowed: whether others may move the subject's portrait.
    """

    look: Look
    subject_name: str | None
    unlit_allowed: bool
    avatar_allowed: bool

    def with_renamed(self, name: str, new_name: str) -> ScenePoint:
        """The same, where subject `name` is called `new_name` now."""
        return replace(self, subject_name=new_name) if self.subject_name == name else self


TakeStep = Callable[[ScenePoint, Callable[[ScenePoint], T]], T | None]
"""`SceneHistory.undo` or `SceneHistory.redo`."""


@dataclass(frozen=True)
class _Step:
    """A change: what was before it, which fields it changed, and when it was last added to."""

    before: ScenePoint
    fields: frozenset[str]
    at: float


class SceneHistory:
    """What was shown before each change, and what was undone. Not thread-safe."""

    def __init__(self, clock: Clock) -> None:
        """`clock` tells which changes belong to one step."""
        self._clock = clock
        self._past: deque[_Step] = deque(maxlen=MAX_STEPS)
        self._undone: list[ScenePoint] = []

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is an undone step to do again."""
        return bool(self._undone)

    def clear(self) -> None:
        """Forget all steps."""
        self._past.clear()
        self._undone.clear()

    def note(self, before: ScenePoint, after: ScenePoint, own_step: bool = False) -> None:
        """Take in a change; one that changes nothing is no step. What was undone cannot be done again after it.

        With `own_step` it is a step of its own, whatever was changed before it.
        """
        fields = changed_fields(before, after)
        if not fields:
            return
        now = self._clock.now()
        last = self._past[-1] if self._past else None
        self._undone.clear()
        if last is not None and not own_step and fields <= last.fields and now - last.at < SAME_STEP_S:
            self._past[-1] = _Step(last.before, last.fields, now)
        else:
            self._past.append(_Step(before, fields, now))

    def undo(self, now: ScenePoint, restore: Callable[[ScenePoint], T]) -> T | None:
        """What `restore` makes of the scene before the last step; None if there is none.

        A step that cannot be restored (RelitError) is dropped: every error is passed on.
        """
        if not self._past:
            return None
        restored = _restored(self._past, self._past[-1].before, restore)
        self._undone.append(now)
        return restored

    def redo(self, now: ScenePoint, restore: Callable[[ScenePoint], T]) -> T | None:
        """What `restore` makes of the scene after the last undone step; None if there is none, errors as in `undo`."""
        if not self._undone:
            return None
        restored = _restored(self._undone, self._undone[-1], restore)
        # No later change belongs to this step, whatever its fields are.
        self._past.append(_Step(now, frozenset(), self._clock.now()))
        return restored

    def rename_subject(self, name: str, new_name: str) -> None:
        """Note that a stored subject has another name now."""
        self._past = deque(
            (replace(step, before=step.before.with_renamed(name, new_name)) for step in self._past), maxlen=MAX_STEPS
        )
        self._undone = [point.with_renamed(name, new_name) for point in self._undone]


def _restored(steps: deque[_Step] | list[ScenePoint], point: ScenePoint, restore: Callable[[ScenePoint], T]) -> T:
    """What `restore` makes of the last of the steps, which is taken off, unless another error than RelitError came."""
    try:
        restored = restore(point)
    except RelitError:
        steps.pop()
        raise
    steps.pop()
    return restored


def changed_fields(before: ScenePoint, after: ScenePoint) -> frozenset[str]:
    """The names of what differs: the lighting field by field."""
    old, new = _values(before), _values(after)
    return frozenset(name for name, value in new.items() if value != old[name])


def _values(point: ScenePoint) -> dict[str, object]:
    look = point.look
    return {
        **{f"lighting.{name}": getattr(look.lighting, name) for name in type(look.lighting).model_fields},
        "background": look.background,
        "mode": look.mode,
        "subject": point.subject_name,
        "unlit_allowed": point.unlit_allowed,
        "avatar_allowed": point.avatar_allowed,
    }
