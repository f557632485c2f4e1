"""How well a face is followed through a rendered capture: the ways of thesis 4.2 beside ours, against the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relit_camera.capture.flash.brightness import watch
from relit_camera.capture.flash.classify import find_flashes
from relit_camera.capture.flash.kind import Kind
from relit_camera.capture.locate_face import locate_face
from relit_camera.capture.stabilise.rigid import Rigid, interpolate, rows_of
from relit_camera.capture.stabilise.stabilise import stabilise
from relit_camera.errors import InputError, ModelError
from relit_camera.evaluate.json_file import Record, read_json
from relit_camera.evaluate.stabilisation_film import Film, look
from relit_camera.evaluate.stabilisers import STABILISERS, register_landmarks
from relit_camera.face.state import Tracker
from relit_camera.face.trackers import TrackerOptions, open_tracker

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
Seen = Literal["bright", "dark", "both"]

NONE, OURS = "none", "ours"
_LANDMARKS = "landmarks"
_TRACKERS = ("mesh", "openseeface")


class _ToRest(Record):
    rotation_deg: float
    translation_px: tuple[float, float]


class _Head(Record):
    to_rest: _ToRest


class _TrueFrame(Record):
    head: _Head


class _Truth(Record):
    frames: list[_TrueFrame] = Field(min_length=1)


@dataclass(frozen=True, eq=False)
class MotionErrors:
    """What a way to follow the face leaves of the head's motion in the bright frames.

    Attributes:
        method: its name.
        seen: the frames that it looks at. Between dark ones their transforms are interpolated by time.
        rotation_deg: (bright,) found minus true, mean taken out: which frame is the reference does not matter.
        translation_px: (bright, 2) the same.
        lost: frames in which it found no face; they keep the last transform.
    """

    method: str
    seen: Seen
    rotation_deg: Floats
    translation_px: Floats
    lost: int

    @property
    def distance_px(self) -> Floats:
        """Length (bright,) of the translation's error."""
        return np.asarray(np.linalg.norm(self.translation_px, axis=1))


@dataclass(frozen=True, eq=False)
class StabilisationReport:
    """All ways on one video.

    Attributes:
        index: (bright,) of the frames that are compared.
        errors: of none, of the thesis's ways in its order, of ours.
        left_out: way → why it was not tried.
    """

    index: Indices
    errors: Sequence[MotionErrors]
    left_out: Mapping[str, str]


def compare_stabilisation(
    video: Path, truth: Path, progress: Callable[[str, int], None] = lambda what, frames: None
) -> StabilisationReport:
    """Follow the face in every way, and compare the transforms of the bright frames with the truth.

    Args:
        video: a rendered capture.
        truth: its truth.json.
        progress: called with what is being done and the number of frames looked at.

    Raises:
        VideoError: the video cannot be read, or shows no face.
        CaptureError: there is no flash in it, or no face can be followed.
        InputError: the truth is missing, in another form, or of another video.
    """
    known = read_json(truth, _Truth, "give the truth.json of a rendered capture")
    seen = watch(video, progress=partial(progress, "Looking for flashes"))
    if len(seen.times_s) != len(known.frames):
        what = f"{video} has {len(seen.times_s)} frames, {truth} {len(known.frames)}"
        raise InputError(what, "both must be of the same video")
    flashes = find_flashes(seen)
    circle = locate_face(seen, flashes).circle
    bright = flashes.indices(Kind.BRIGHT)
    rest = [known.frames[index].head.to_rest for index in bright]
    true_rows = np.array([[each.rotation_deg, *each.translation_px] for each in rest])
    tracker, left_out = _tracker()
    film = look(video, flashes, circle, tracker, partial(progress, "Looking at the face"))
    errors = [_errors(NONE, "both", [Rigid()] * len(bright), true_rows, 0)]
    choices: tuple[tuple[Seen, NDArray[np.bool_]], ...] = (("bright", film.bright), ("dark", ~film.bright))
    for method in [*STABILISERS, *([_LANDMARKS] if tracker else [])]:
        for kind, chosen in choices:
            found = _follow(method, film, chosen, seen.size)
            times_s = flashes.times_s[film.index[chosen]]
            every = interpolate(flashes.times_s[bright], times_s, _last_known(found))
            errors.append(_errors(method, kind, every, true_rows, found.count(None)))
    ours = stabilise(video, flashes, circle, progress=partial(progress, "Stabilising"))
    every = [ours.transforms[index] for index in bright]
    errors.append(_errors(OURS, "both", every, true_rows, len(ours.lost)))
    return StabilisationReport(bright, errors, left_out)


def _follow(method: str, film: Film, chosen: NDArray[np.bool_], size: tuple[int, int]) -> list[Rigid | None]:
    """Transforms, in the video's pixels, of the chosen frames of a film."""
    if method == _LANDMARKS:
        return register_landmarks([film.landmarks[index] for index in np.flatnonzero(chosen).tolist()], size)
    found = STABILISERS[method](film.squares[chosen], film.circle_in_square)
    return [film.in_video(transform) for transform in found]


def _last_known(transforms: Sequence[Rigid | None]) -> list[Rigid]:
    """Transforms, those missing filled with the last one before; with none at the beginning."""
    filled: list[Rigid] = []
    for transform in transforms:
        filled.append(transform or (filled[-1] if filled else Rigid()))
    return filled


def _errors(method: str, seen: Seen, found: Sequence[Rigid], true_rows: Floats, lost: int) -> MotionErrors:
    left = rows_of(found) - true_rows
    left -= left.mean(axis=0)
    return MotionErrors(method, seen, left[:, 0], left[:, 1:], lost)


def _tracker() -> tuple[Tracker | None, dict[str, str]]:
    """The best tracker of landmarks that is installed; or none, and why."""
    why = ""
    for name in _TRACKERS:
        try:
            return open_tracker(name, TrackerOptions(blendshapes=False)), {}
        except ModelError as error:
            why = why or str(error)
    return None, {_LANDMARKS: why}
