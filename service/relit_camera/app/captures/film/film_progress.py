"""How far the work on a film is: its steps, what each has taken, and the share of all that is done."""

from __future__ import annotations

from relit_camera.base.concurrency.clock import Clock
from relit_camera.live.status.film_status import FilmStep

SHARES = {
    "Looking for flashes": 0.1,
    "Looking for the mirror ball": 0.06,
    "Following the face": 0.12,
    "Looking at the light": 0.1,
    "Cutting out the flash's light": 0.06,
    "Finding the person": 0.04,
    "Building the field": 0.46,
    "Looking at the film's end": 0.04,
    "Drawing first pictures": 0.02,
}
"""Name of each step in its order → share of the time, roughly: the field takes half of it (docs/capture.md). They are
the names that `capture.film.pipeline.film_subject`, `film_coda` and the worker tell; importing them would slow the
camera's start.
"""
FIRST_OF_BUILDING = "Building the field"
_NAMES = tuple(SHARES)


class FilmProgress:
    """The steps of one run of the work. Not thread-safe."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._step = -1
        self._done_of_step = 0.0
        self._began_at = 0.0
        self._seconds = [0.0] * len(_NAMES)

    @property
    def is_building(self) -> bool:
        """Whether the film is read, and the subject is made of what it gave."""
        return self._step >= _NAMES.index(FIRST_OF_BUILDING)

    def note(self, name: str, done: int, total: int | None) -> bool:
        """Note what a step tells; returns whether it has just begun. Steps of other names are passed over."""
        if name not in SHARES:
            return False
        step = _NAMES.index(name)
        begins = step != self._step
        if begins:
            self._end_step()
            self._step, self._began_at = step, self._clock.now()
        self._done_of_step = min(done / total, 1.0) if total else 0.0
        return begins

    def finish(self) -> None:
        """Note that all steps are done."""
        self._end_step()
        self._step = len(_NAMES)

    def steps(self) -> tuple[FilmStep, ...]:
        """All steps in their order. Those that were passed over, because what they give was kept, are done."""
        steps = []
        for index, (name, seconds) in enumerate(zip(_NAMES, self._seconds, strict=True)):
            if index == self._step:
                steps.append(FilmStep(name, "running", round(self._clock.now() - self._began_at, 1)))
            else:
                steps.append(FilmStep(name, "done" if index < self._step else "waiting", round(seconds, 1)))
        return tuple(steps)

    def share(self) -> float:
        """Share of the work that is done, 0 to 1."""
        shares = tuple(SHARES.values())
        before = sum(shares[: max(self._step, 0)])
        running = shares[self._step] * self._done_of_step if 0 <= self._step < len(shares) else 0.0
        return round(min((before + running) / sum(shares), 1.0), 4)

    def _end_step(self) -> None:
        if 0 <= self._step < len(_NAMES):
            self._seconds[self._step] = self._clock.now() - self._began_at
