"""Which frames of a film become expression stills: those that together show most of what a face does."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError
from relit_camera.base.rotations import angles_from_rotation
from relit_camera.capture.expressions.film_tracking import TrackedFace, TrackedFilm
from relit_camera.face.landmarks.expression_features import (
    CLOSURE,
    WIDTH_CM,
    eye_closure,
    lid_gap_cm,
    mouth_features,
    mouth_gap_cm,
)
from relit_camera.subject.expression_stills import MAX_STILLS


@dataclass(frozen=True)
class SelectionTunables:
    """How stills are chosen.

    Attributes:
        min_sharpness: of that of a sharp frame (the 90th percentile).
        mouths, shut_eyes, turns: most stills of each kind.
        least_distance: from what is chosen, in units of the features, below which a frame shows nothing new.
        frontal_deg: largest turn in stills of mouth and eyes.
        turned_deg: least turn in stills of a turned head.
        shut: closure from which an eye is shut, and up to which it is open.
        min_stills: fewer show too little.
    """

    min_sharpness: float = 0.35
    mouths: int = 10
    shut_eyes: int = 2
    turns: int = 5
    least_distance: float = 0.5
    frontal_deg: float = 14.0
    turned_deg: float = 10.0
    shut: tuple[float, float] = (0.6, 0.35)
    min_stills: int = 4


TUNABLES = SelectionTunables()
TURN_UNIT_DEG = 12.0


@dataclass(frozen=True, eq=False)
class ShownFace:
    """What a tracked face does, as it is chosen by.

    Attributes:
        face: the tracked face.
        yaw, pitch: since neutral, in degrees.
        mouth: see `mouth_features`, minus those of the neutral face.
        gap_cm: between the lips, beyond the neutral face's.
        closure: of the eye that is less shut, see `eye_closure`.
        quality: 0..1, by sharpness.
    """

    face: TrackedFace
    yaw: float
    pitch: float
    mouth: NDArray[np.float64]
    gap_cm: float
    closure: float
    quality: float

    @property
    def turn_deg(self) -> float:
        """Larger of yaw and pitch."""
        return max(abs(self.yaw), abs(self.pitch))

    @property
    def is_frontal(self) -> bool:
        """Whether it may be a still of mouth and eyes."""
        return self.turn_deg < TUNABLES.frontal_deg

    @property
    def is_turned(self) -> bool:
        """Whether it may be a still of a turned head."""
        return self.turn_deg > TUNABLES.turned_deg and self.closure < TUNABLES.shut[1]

    @property
    def may_be_still(self) -> bool:
        """Whether it is sharp enough, and one of these."""
        return self.quality >= TUNABLES.min_sharpness and (self.is_frontal or self.is_turned)


@dataclass(frozen=True)
class CoverageItem:
    """Something that stills may show.

    Attributes:
        name: what it is called. Right and left are the person's own.
        cure: what the person does for it, as a clause.
        is_shown: whether a face does it.
    """

    name: str
    cure: str
    is_shown: Callable[[ShownFace], bool]


COVERAGE = (
    CoverageItem(
        "wide mouth", "smile with your teeth showing: say 'cheese'", lambda shown: shown.mouth[2] > 0.25 / WIDTH_CM
    ),
    CoverageItem("lips apart", "talk: count from one to five", lambda shown: shown.gap_cm > 0.3),
    CoverageItem("round mouth", "say 'oo'", lambda shown: shown.mouth[2] < -0.25 / WIDTH_CM),
    CoverageItem("jaw dropped", "open your mouth wide", lambda shown: shown.gap_cm > 1.2),
    CoverageItem("eyes shut", "shut your eyes for a second", lambda shown: shown.closure > TUNABLES.shut[0]),
    CoverageItem("turned right", "turn your head slowly to your right", lambda shown: shown.yaw < -15),
    CoverageItem("turned far right", "turn your head further to your right", lambda shown: shown.yaw < -25),
    CoverageItem("turned left", "turn your head slowly to your left", lambda shown: shown.yaw > 15),
    CoverageItem("turned far left", "turn your head further to your left", lambda shown: shown.yaw > 25),
)
"""What stills may show, in the order in which a person is asked for it."""


@dataclass(frozen=True)
class Selection:
    """The chosen frames.

    Attributes:
        faces: in order of time.
        covered: names of what they show, in the order of `COVERAGE`.
    """

    faces: tuple[TrackedFace, ...]
    covered: tuple[str, ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """What to do in another film for what they do not show, a clause each."""
        return tuple(item.cure for item in COVERAGE if item.name not in self.covered)


def select_stills(film: TrackedFilm) -> Selection:
    """Choose the frames of a film that become stills, by farthest-point selection in what the face does.

    Raises:
        CaptureError: the face does too little.
    """
    shown = [each for each in shown_faces(film) if each.may_be_still]
    frontal = [each for each in shown if each.is_frontal]
    shut = [each for each in frontal if each.closure > TUNABLES.shut[0]]
    turned = [each for each in shown if each.is_turned]
    chosen = [
        *sorted(shut, key=lambda each: -each.closure * each.quality)[:1],
        *_farthest(frontal, lambda each: each.mouth, TUNABLES.mouths),
        *_farthest(frontal, lambda each: np.array([each.closure / CLOSURE]), TUNABLES.shut_eyes),
        *_farthest(turned, _turn, TUNABLES.turns, lambda each: float(np.exp(-0.1 * (each.mouth**2).sum()))),
    ]
    for item in COVERAGE:  # each thing that some frame shows, a still does too
        doing = [each for each in shown if item.is_shown(each)]
        if doing and not any(item.is_shown(each) for each in chosen):
            chosen.append(max(doing, key=lambda each: each.quality))
    kept = list({each.face.index: each for each in chosen}.values())[:MAX_STILLS]
    faces = sorted((each.face for each in kept), key=lambda face: face.index)
    selection = Selection(tuple(faces), what_is_shown(kept))
    if len(faces) < TUNABLES.min_stills:
        raise CaptureError(
            f"the face in {film.name} does too little: {len(faces)} frames differ from the neutral face",
            f"film again, and {', '.join(selection.missing)}",
        )
    return selection


def what_is_shown(faces: Collection[ShownFace]) -> tuple[str, ...]:
    """Names of what some faces do, in the order of `COVERAGE`."""
    return tuple(item.name for item in COVERAGE if any(item.is_shown(each) for each in faces))


def _turn(shown: ShownFace) -> NDArray[np.float64]:
    return np.array([shown.yaw, shown.pitch]) / TURN_UNIT_DEG


def _farthest(
    candidates: Sequence[ShownFace],
    features: Callable[[ShownFace], NDArray[np.float64]],
    most: int,
    worth: Callable[[ShownFace], float] = lambda each: 1.0,
) -> list[ShownFace]:
    """Candidates far from neutral (0) and from each other, each time the farthest; good ones count as farther."""
    if not candidates:
        return []
    places = np.stack([features(each) for each in candidates])
    value = np.array([each.quality**0.5 * worth(each) for each in candidates])
    distance = np.linalg.norm(places, axis=1)
    chosen: list[ShownFace] = []
    while len(chosen) < most:
        best = int((distance * value).argmax())
        if distance[best] < TUNABLES.least_distance:
            break
        chosen.append(candidates[best])
        distance = np.minimum(distance, np.linalg.norm(places - places[best], axis=1))
    return chosen


def shown_faces(film: TrackedFilm, first: int = 0) -> list[ShownFace]:
    """What the faces of a film do, from the one of number `first` on."""
    scheme, neutral = film.scheme, film.neutral.points
    sharp = float(np.percentile([face.sharpness for face in film.faces], 90))
    mouth, gap = mouth_features(neutral, scheme), mouth_gap_cm(neutral, scheme)
    eyes = [(eye, lid_gap_cm(neutral, eye)) for eye in (scheme.right_eye, scheme.left_eye)]
    result = []
    for face in film.faces[first:]:
        yaw, pitch, _ = angles_from_rotation(film.rotation(face))
        closure = min(eye_closure(face.points, eye, neutral_gap_cm) for eye, neutral_gap_cm in eyes)
        result.append(
            ShownFace(
                face,
                yaw,
                pitch,
                mouth_features(face.points, scheme) - mouth,
                mouth_gap_cm(face.points, scheme) - gap,
                closure,
                float(np.clip(face.sharpness / max(sharp, 1e-9), 0, 1)),
            )
        )
    return result
