"""What a person before the webcam is asked to do for expression stills, and what the frames so far show of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from relit_camera.base.rotations import Rotation
from relit_camera.capture.expressions.film_tracking import FaceCollection, TrackedFace
from relit_camera.capture.expressions.still_selection import COVERAGE, shown_faces, what_is_shown
from relit_camera.face.motion.neutral_face import is_frontal

NEUTRAL = "neutral"
"""Name of the first prompt: all else is measured against the neutral face."""
PROMPTS = {NEUTRAL: "look into the camera, your mouth shut", **{item.name: item.cure for item in COVERAGE}}
"""What is asked for, in its order: name → what to do, as a clause."""


@dataclass(frozen=True)
class PromptTunables:
    """How long a person is asked for something.

    Attributes:
        longest_s: after which the next prompt is due, though nothing shows what this one asks for.
        longest_gap_s: between two frames with a face that counts: whoever is away has not been asked.
        neutral_frames: with a face from the front, after which the neutral one is known.
        judging_s: least time between two looks at what the frames show.
        neutral_turn_deg: by which the neutral head may turn, as more frames come, until all are judged anew.
    """

    longest_s: float = 8.0
    longest_gap_s: float = 0.5
    neutral_frames: int = 24
    judging_s: float = 0.4
    neutral_turn_deg: float = 1.0


TUNABLES = PromptTunables()


class PromptSequence:
    """Which prompt is due: each until what it asks for is covered, or its time is over."""

    def __init__(self) -> None:
        self._asked_s = dict.fromkeys(PROMPTS, 0.0)
        self._covered: Collection[str] = ()
        self._last_s: float | None = None

    @property
    def name(self) -> str | None:
        """Of the prompt that is due; None where all are over."""
        return next((name for name in PROMPTS if not self._is_over(name)), None)

    @property
    def share(self) -> float:
        """Share of the prompts that are over, 0 to 1."""
        return sum(map(self._is_over, PROMPTS)) / len(PROMPTS)

    def update(self, time_s: float, covered: Collection[str]) -> None:
        """Note a frame with a face.

        Args:
            time_s: of the frame; later than those before.
            covered: names of what the frames so far show.
        """
        due = self.name
        passed = 0.0 if self._last_s is None else time_s - self._last_s
        self._last_s, self._covered = time_s, covered
        if due is not None:
            self._asked_s[due] += min(passed, TUNABLES.longest_gap_s)

    def _is_over(self, name: str) -> bool:
        return name in self._covered or self._asked_s[name] >= TUNABLES.longest_s


class LiveCoverage:
    """What the frames so far show, by the measures that choose the stills at the end.

    Attributes:
        covered: names of it, in the order of `PROMPTS`.
    """

    def __init__(self, faces: FaceCollection) -> None:
        """`faces` are those of the filming."""
        self._faces = faces
        self._frontal = 0
        self._judged = 0
        self._neutral: Rotation | None = None
        self._next_s = 0.0
        self.covered: tuple[str, ...] = ()

    def update(self, face: TrackedFace, neutral_due: bool) -> None:
        """Note the face of one more frame.

        Args:
            face: the last one of the faces.
            neutral_due: whether the neutral face is still asked for: it is waited for then.

        Raises:
            CaptureError: no stills can be made of such faces: they are too small, or in the dark.
        """
        self._frontal += is_frontal(face.pose)
        if face.time_s < self._next_s or (neutral_due and self._frontal < TUNABLES.neutral_frames):
            return
        self._next_s = face.time_s + TUNABLES.judging_s
        film = self._faces.film()
        rotation = film.neutral.pose.rotation
        if self._neutral is None or _angle_deg(rotation, self._neutral) > TUNABLES.neutral_turn_deg:
            self._neutral, self._judged, self.covered = rotation, 0, ()
        new = [each for each in shown_faces(film, self._judged) if each.may_be_still]
        self._judged = len(film.faces)
        shown = {NEUTRAL, *self.covered, *what_is_shown(new)}
        self.covered = tuple(name for name in PROMPTS if name in shown)


def _angle_deg(one: Rotation, other: Rotation) -> float:
    return float(np.degrees(np.linalg.norm((one * other.inv()).as_rotvec())))
