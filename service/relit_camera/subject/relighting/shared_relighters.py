"""One relighter for everybody who relights the same subject: it takes a fifth of a second to make, and some 20 MB.

The pipeline, what stands in for it, and the pictures of the subject in each place want one at about the same time. Mode
live wants another one of the subject at half its size, which shares the mixes of clusters, most of the bytes.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.relighting.relighter import RelighterOptions
from relit_camera.subject.subject import Subject

RelighterMaker = Callable[[Subject, RelighterOptions, BasisRelighter | None], BasisRelighter]

WAIT_S = 5.0
"""How long somebody who makes a relighter is waited for."""


@dataclass(eq=False)
class _Entry:
    """The relighter of one subject, with so many threads, for as long as somebody has it."""

    subject: weakref.ref[Subject]
    threads: int
    lock: threading.Lock = field(default_factory=threading.Lock)
    relighter: weakref.ref[BasisRelighter] | None = None


class SharedRelighters:
    """Makes each relighter once, and keeps none that nobody has any more. Thread-safe."""

    def __init__(self, make: RelighterMaker = BasisRelighter) -> None:
        """`make` makes a relighter: of a subject, options, and another one whose coefficients and mixes it may use."""
        self._make = make
        self._lock = threading.Lock()
        self._entries: list[_Entry] = []

    def get(self, subject: Subject, options: RelighterOptions | None = None) -> BasisRelighter:
        """The relighter of that very object; whoever comes while it is made waits for it, but not for `WAIT_S`."""
        options = options or RelighterOptions()
        entry = self._entry(subject, options.session.threads)
        if not entry.lock.acquire(timeout=WAIT_S):
            return self._make(subject, options, None)  # whoever makes it hangs
        try:
            relighter = None if entry.relighter is None else entry.relighter()
            if relighter is None:
                relighter = self._make(subject, options, self._with_same_mixes(subject, options.session.threads))
                entry.relighter = weakref.ref(relighter)
            return relighter
        finally:
            entry.lock.release()

    def made(self, subject: Subject) -> BasisRelighter | None:
        """The relighter that somebody has of that very object; None where nobody has one yet."""
        with self._lock:
            entries = [entry for entry in self._entries if entry.subject() is subject]
        found = (entry.relighter() for entry in entries if entry.relighter is not None)
        return next((relighter for relighter in found if relighter is not None), None)

    def _with_same_mixes(self, subject: Subject, threads: int) -> BasisRelighter | None:
        """A relighter of the same person in another size, as far as somebody has one."""
        if subject.basis.values.dtype != np.int8:
            return None  # in 8 bits it has mixes of its own
        with self._lock:
            entries = [entry for entry in self._entries if entry.threads == threads]
        for entry in entries:
            other, relighter = entry.subject(), None if entry.relighter is None else entry.relighter()
            if other is None or relighter is None or subject.coefficients is not other.coefficients:
                continue
            if subject.basis.has_mixes_of(other.basis):
                return relighter
        return None

    def _entry(self, subject: Subject, threads: int) -> _Entry:
        with self._lock:
            self._entries = [entry for entry in self._entries if entry.subject() is not None]
            for entry in self._entries:
                if entry.subject() is subject and entry.threads == threads:
                    return entry
            self._entries.append(_Entry(weakref.ref(subject), threads))
            return self._entries[-1]


_SHARED = SharedRelighters()


def shared_relighter(subject: Subject, options: RelighterOptions | None = None) -> BasisRelighter:
    """The relighter of a subject that everybody in this process shares; see `SharedRelighters.get`."""
    return _SHARED.get(subject, options)


def made_relighter(subject: Subject) -> BasisRelighter | None:
    """The shared relighter of a subject if there is one; see `SharedRelighters.made`."""
    return _SHARED.made(subject)
