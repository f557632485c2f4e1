"""Whether a followed face is a certain person's, by the last few embeddings of it.

A single look can mislead: a hand before the mouth, a turned head. So the median of some looks decides, and what is near
the threshold changes nothing. No clock is read here: every time is an argument.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from relit_camera.face.identity.face_embedder import Embedding


class Verdict(StrEnum):
    """What is known of a face."""

    SAME = "same"
    """It is the person's."""
    OTHER = "other"
    """It is somebody else's."""
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class JudgeTunables:
    """When a face is looked at, and how it is judged, measured on recorded people ("Who it is" in docs/trackers.md).

    Attributes:
        distance: of the embeddings of one person at most.
        margin: so near the threshold the verdict stays what it was.
        looks: the last so many decide.
        least_looks: with fewer nothing is judged.
        interval_s: between two looks at a face that is followed.
        first_interval_s: the same until there are enough looks.
        gap_s: a face that was not found for longer may be another person's.
    """

    distance: float = 0.55
    margin: float = 0.03
    looks: int = 5
    least_looks: int = 3
    interval_s: float = 1.0
    first_interval_s: float = 0.2
    gap_s: float = 1.0


class PersonTrack:
    """The looks at one face while it is followed."""

    def __init__(self, tunables: JudgeTunables | None = None) -> None:
        """Nobody is followed yet."""
        self.tunables = tunables or JudgeTunables()
        self._looks: deque[Embedding] = deque(maxlen=self.tunables.looks)
        self._found_s = self._looked_s = -np.inf
        self._number = 0

    @property
    def looks(self) -> Sequence[Embedding]:
        """The last looks, the oldest first."""
        return tuple(self._looks)

    @property
    def number(self) -> int:
        """Counts the faces: another number is another face, or the same one after it was lost."""
        return self._number

    def found(self, time_s: float) -> None:
        """The face is followed at this time. Call for every frame in which it is found."""
        if not 0 <= time_s - self._found_s <= self.tunables.gap_s:
            self.forget()
        self._found_s = time_s

    def forget(self) -> None:
        """Whoever is found next may be another person."""
        self._looks.clear()
        self._found_s = self._looked_s = -np.inf
        self._number += 1

    def is_due(self, time_s: float) -> bool:
        """Whether a face that is found at this time is to be looked at."""
        limits = self.tunables
        interval_s = limits.interval_s if len(self._looks) == limits.looks else limits.first_interval_s
        return time_s - self._looked_s >= interval_s

    def add(self, embedding: Embedding, time_s: float) -> None:
        """Take a look at the face as it is found at this time."""
        self.found(time_s)
        self._looks.append(embedding)
        self._looked_s = time_s


class IdentityJudge:
    """Says whether a followed face is the person's of a reference embedding."""

    def __init__(self, track: PersonTrack, reference: Embedding) -> None:
        self._track = track
        self._reference = reference
        self._verdict, self._number = Verdict.UNKNOWN, track.number

    def judge(self) -> Verdict:
        """What the looks at the face say by now."""
        track, limits = self._track, self._track.tunables
        if track.number != self._number:
            self._verdict, self._number = Verdict.UNKNOWN, track.number
        if len(track.looks) >= limits.least_looks:
            distance = median_distance(track.looks, self._reference)
            if distance <= limits.distance - limits.margin:
                self._verdict = Verdict.SAME
            elif distance >= limits.distance + limits.margin:
                self._verdict = Verdict.OTHER
        return self._verdict


def median_distance(looks: Sequence[Embedding], reference: Embedding) -> float:
    """The median distance of some looks, at least one, from a reference."""
    return float(np.median(np.linalg.norm(np.stack(looks) - reference, axis=1)))
