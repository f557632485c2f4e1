"""How each rung of the ladder makes a subject of a known person."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from relit_camera.base.errors import NotFoundError
from relit_camera.capture.instant.instant_capture import build_instant_subject
from relit_camera.capture.reflectance.sampled_region import with_black_ring
from relit_camera.lab.evaluate.field.ground_truth import subsample_lights
from relit_camera.lab.evaluate.ladder.desk_rung import desk_subject
from relit_camera.lab.evaluate.ladder.known_person import KnownPerson, SubjectFolder
from relit_camera.lab.evaluate.ladder.webcam_frames import RoomFrames
from relit_camera.subject.subject import Subject

FILM_REACH_DEG = 75.0
"""Angle from the camera's axis that a hand with a lamp reaches."""
THESIS_METHOD = "barycentric"
"""The thesis's own method: spherical barycentric weights (5.2), with its black ring round the captured lights (5.6)."""
TINT = "tint"
"""Name of the baseline that has no subject: the picture times one color."""

Build = Callable[[KnownPerson, RoomFrames, SubjectFolder], Subject]


@dataclass(frozen=True)
class Rung:
    """One way to a subject.

    Attributes:
        summary: one line, for reports.
        build: of the person, who is filmed in a room; only where `of_room` do the frames matter.
        of_room: whether it is made anew in each room, of the frames of that room.
        own_frame: whether its pictures are cut in another way than the known ones.
    """

    summary: str
    build: Build
    of_room: bool = False
    own_frame: bool = False


def _full(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    return person.subject


def _film(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    return subjects.subject(f"{person.name}-film", subsample_lights(person.samples, FILM_REACH_DEG))


def _thesis(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    ringed = with_black_ring(subsample_lights(person.samples, FILM_REACH_DEG))
    return subjects.subject(f"{person.name}-thesis", ringed, THESIS_METHOD)


def _instant(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    return build_instant_subject(frames.frames, frames.room.name)


def _desk(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    return subjects.made_of(person, "desk", partial(desk_subject, person, "desk"))


def _laptop(person: KnownPerson, frames: RoomFrames, subjects: SubjectFolder) -> Subject:
    return subjects.made_of(person, "laptop", partial(desk_subject, person, "laptop"))


RUNGS: Mapping[str, Rung] = {
    "instant": Rung("a few webcam frames in the light of the room itself", _instant, of_room=True, own_frame=True),
    "laptop": Rung("patterns on a laptop's screen, its webcam on top", _laptop, own_frame=True),
    "desk": Rung("patterns on a monitor of 27 inches, the webcam on top", _desk, own_frame=True),
    "thesis": Rung(f"the thesis's method, lamp within {FILM_REACH_DEG:.0f} degrees", _thesis),
    "film": Rung(f"the default method, lamp within {FILM_REACH_DEG:.0f} degrees", _film),
    "full": Rung("all lights: the truth itself, so only the room's estimate and the ratio are measured", _full),
}
"""By name, from the lowest to the highest."""


def rung_names(chosen: Sequence[str] | None) -> list[str]:
    """The chosen rungs, or all, lowest first.

    Raises:
        NotFoundError: there is no rung of a name.
    """
    for name in chosen or ():
        if name not in RUNGS:
            raise NotFoundError(f"no rung is called '{name}'", f"there are: {', '.join(RUNGS)}")
    return [name for name in RUNGS if not chosen or name in chosen]
