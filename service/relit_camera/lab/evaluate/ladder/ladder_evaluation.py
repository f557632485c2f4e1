"""The ladder's rungs on a known person: how near each comes to the truth, as a field and in mode live."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import InputError, SubjectError
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.capture.alignment.picture_set_alignment import align_to_prediction, apply_alignment
from relit_camera.face.face_state import Tracker
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.lab.evaluate.ladder.known_person import KnownPerson, SubjectFolder, within_border
from relit_camera.lab.evaluate.ladder.ladder_metrics import (
    FieldFigures,
    Pictures,
    brightness_ev,
    field_figures,
    shown_psnr,
    tinted,
)
from relit_camera.lab.evaluate.ladder.ladder_rungs import RUNGS, TINT, Rung
from relit_camera.lab.evaluate.ladder.live_ratio import FollowedFrame, LiveRatio, follow
from relit_camera.lab.evaluate.ladder.webcam_frames import RoomFrames, enlarged, film_in_room
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import LightMap
from relit_camera.live.modes.ratio_relighting import fit_similarity
from relit_camera.live.modes.source_masks import ratio_confidence
from relit_camera.live.reenactment.source_image import feather_edges
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject import Subject

OPAQUE = 0.95
"""Matte from which a pixel of a frame counts: below, it shows too much of the room."""
WHOLLY_TRUSTED = 0.95
"""Confidence of mode live in the true matte from which a pixel lies well inside the person."""
FRAMES = 12
"""Webcam frames in each room: the last is relit, three seconds after the first."""


@dataclass(frozen=True)
class RungFigures:
    """One rung while the person sits in one room; without a subject there are no figures.

    Attributes:
        ratio_db: environment → PSNR of the live picture in its light, for all but the room itself.
        inner_db: the same, only of pixels that lie well inside the person: at the rim, mode live does not trust any
            subject (see `ratio_confidence`).
        brightness_ev: how much brighter than the truth the pictures are, mean over the environments, in stops.
        field: figures of the field; None where it is the truth's own.
        residual: how badly the room's estimated light explains the face, see `RoomLightEstimate`.
        build_s: seconds that building the subject took, where it is made of the room's frames.
        failure: why there is no subject; empty where there is.
    """

    ratio_db: Mapping[str, float]
    inner_db: Mapping[str, float]
    brightness_ev: float | None = None
    field: FieldFigures | None = None
    residual: float | None = None
    build_s: float | None = None
    failure: str = ""

    @property
    def mean_ratio_db(self) -> float:
        """Mean over the environments; NaN without a subject."""
        return _mean(self.ratio_db)

    @property
    def mean_inner_db(self) -> float:
        """Mean of `inner_db`; NaN without a subject."""
        return _mean(self.inner_db)


@dataclass(frozen=True)
class RoomPictures:
    """What a person looks like who sits in a room.

    Attributes:
        live: the webcam's last frame.
        matte: (side, side) of the person in it.
        truths: environment → the person as a perfect relighting shows them, over black.
        relit: rung → environment → the live picture in its light.
    """

    live: DisplayImage
    matte: Mask
    truths: Mapping[str, DisplayImage]
    relit: Mapping[str, Mapping[str, DisplayImage]]


@dataclass(frozen=True)
class RoomResult:
    """All rungs of one person in one room.

    Attributes:
        person, room: names.
        figures: by rung, lowest first.
        pictures: what they show.
    """

    person: str
    room: str
    figures: Mapping[str, RungFigures]
    pictures: RoomPictures


def evaluate_person(
    person: KnownPerson,
    rooms: Sequence[Environment],
    environments: Sequence[Environment],
    rungs: Sequence[str],
    tracker: Tracker,
    subjects: SubjectFolder,
) -> Iterator[RoomResult]:
    """The rungs of these names in each room, and the tint beside them.

    Args:
        person: whose field is known.
        rooms: in which the person sits before the webcam.
        environments: into which the live picture is taken, and under which fields are compared.
        rungs: names of `RUNGS`.
        tracker: finds the face in frames and subjects.
        subjects: where subjects are kept that take long.

    Raises:
        SubjectError: no face is found in the webcam's frames.
    """
    truth = _TrueLight(person, environments)
    once: dict[str, _Built] = {}
    for room in rooms:
        frames = film_in_room(person, room, FRAMES)
        followed = follow(frames.frames, tracker)
        figures, relit = {}, {}
        figures[TINT], relit[TINT] = _tint(truth, room, frames)
        for name in rungs:
            rung = RUNGS[name]
            try:
                built = once.get(name) or _build(rung, truth, frames, followed[-1], tracker.scheme, subjects)
                live = LiveRatio(built.subject, tracker, followed)
            except InputError as error:
                figures[name], relit[name] = RungFigures({}, {}, failure=str(error)), {}
                continue
            if not rung.of_room:
                once[name] = built
            relit[name] = {each: live.relit(light) for each, light, _ in truth.others(room)}
            seconds = built.seconds if rung.of_room else None
            shown = truth.shown_figures(room, relit[name])
            figures[name] = RungFigures(*shown, built.field, live.residual, seconds)
        yield RoomResult(
            person.name, room.name, figures, RoomPictures(frames.frames[-1], truth.matte, truth.shown, relit)
        )


@dataclass(frozen=True)
class _Built:
    """A rung's subject, the figures of its field, and the seconds that it took."""

    subject: Subject
    field: FieldFigures | None
    seconds: float


def _build(
    rung: Rung, truth: _TrueLight, frames: RoomFrames, followed: FollowedFrame, scheme: str, subjects: SubjectFolder
) -> _Built:
    started = time.monotonic()
    subject = rung.build(truth.person, frames, subjects)
    seconds = time.monotonic() - started
    if subject is truth.person.subject:
        return _Built(subject, None, seconds)
    relit = BasisRelighter(subject).relight(truth.maps)
    if rung.own_frame:
        relit = in_frame_of(truth.person, subject, relit, truth.relit, followed, scheme)
    return _Built(subject, field_figures(relit, truth.relit, truth.person.counted), seconds)


class _TrueLight:
    """The person truly under each environment.

    Attributes:
        environments: their order is that of `maps`, `relit` and `shown`.
        person: the known person.
        maps: (environments, 32, 64, 3) their light maps in display exposure.
        relit: (environments, height, width, 3) the person, of the known pictures' size.
        large: (environments, side, side, 3) the same, of the frames' size.
        matte: (side, side) of the person in the frames.
        counted: (side, side) pixels of frames that count.
        inner: those of them that lie well inside the person.
        shown: environment → as it is displayed.
    """

    def __init__(self, person: KnownPerson, environments: Sequence[Environment]) -> None:
        self.environments = environments
        self.person, self.environments = person, environments
        self.maps = np.stack([
            each.light_map * np.float32(auto_exposure_scale(each.light_map)) for each in environments
        ])  # fmt: skip
        self.relit: Pictures = person.relighter.relight(self.maps) * np.float32(person.subject.metadata.display_gain)
        self.large = np.stack([enlarged(each) for each in self.relit])
        self.matte = np.minimum(enlarged(person.samples.matte), 1)
        self.counted: NDArray[np.bool_] = within_border(self.matte > OPAQUE)
        trusted = ratio_confidence(feather_edges(person.samples.matte)) > WHOLLY_TRUSTED
        self.inner = self.counted & (enlarged(trusted.astype(np.float32)) > 0.5)
        self.shown = {
            each.name: display_from_linear(picture) for each, picture in zip(environments, self.large, strict=True)
        }

    def others(self, room: Environment) -> Iterator[tuple[str, LightMap, LinearImage]]:
        """Name, light map and true picture, large, of each environment but the room."""
        for environment, light, large in zip(self.environments, self.maps, self.large, strict=True):
            if environment.name != room.name:
                yield environment.name, light, large

    def shown_figures(
        self, room: Environment, pictures: Mapping[str, DisplayImage]
    ) -> tuple[dict[str, float], dict[str, float], float]:
        """`ratio_db`, `inner_db` and `brightness_ev` of `RungFigures`, of pictures by environment."""
        whole, inner = (
            {name: shown_psnr(pictures[name], large, counted) for name, _, large in self.others(room)}
            for counted in (self.counted, self.inner)
        )
        brighter = [brightness_ev(pictures[name], large, self.inner) for name, _, large in self.others(room)]
        return whole, inner, float(np.mean(brighter))


def _tint(truth: _TrueLight, room: Environment, frames: RoomFrames) -> tuple[RungFigures, dict[str, DisplayImage]]:
    live = linear_from_uint8(frames.frames[-1])
    pictures = {name: display_from_linear(tinted(live, large, truth.counted)) for name, _, large in truth.others(room)}
    height, width = truth.person.samples.matte.shape
    small = np.asarray(cv2.resize(live, (width, height), interpolation=cv2.INTER_AREA), np.float32)
    relit = np.stack([tinted(small, each, truth.person.counted) for each in truth.relit])
    field = field_figures(relit, truth.relit, truth.person.counted)
    return RungFigures(*truth.shown_figures(room, pictures), field), pictures


def in_frame_of(
    person: KnownPerson, subject: Subject, relit: Pictures, truth: Pictures, followed: FollowedFrame, scheme: str
) -> Pictures:
    """Pictures (count, …) of a subject with a picture frame of its own, as they lie in the known pictures.

    By the similarity that takes the subject's landmarks onto those of the live frame, and then a small rigid motion,
    since landmarks in two pictures of one face differ by more than its field may.

    Raises:
        SubjectError: the subject keeps no landmarks of the scheme.
    """
    points = subject.landmarks.get(scheme)
    if points is None:
        raise SubjectError(f"the subject keeps no landmarks of scheme '{scheme}'", "build it with that tracker")
    height, width = person.samples.matte.shape
    rigid = list(landmark_scheme(scheme).rigid)
    live = followed.motion.landmarks * (np.array([width, height]) / followed.frame.size)
    transform = fit_similarity(points[rigid].astype(np.float64), live[rigid])
    # A picture that is reduced is averaged first, so that nothing of it is skipped.
    scale = min(float(np.hypot(transform[0, 0], transform[1, 0])), 1.0)
    rows, columns = relit.shape[1:3]
    size = (max(round(columns * scale), 1), max(round(rows * scale), 1))
    transform[:, :2] *= np.array([columns, rows]) / size
    # OpenCV counts pixel centers as integers.
    transform[:, 2] += transform[:, :2] @ (0.5, 0.5) - 0.5

    def warped(picture: NDArray[np.float32]) -> NDArray[np.float32]:
        small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        return np.asarray(cv2.warpAffine(small, transform, (width, height)), np.float32)

    # Both mattes are taken as right: what is compared is how the person looks, not where they end.
    matte = subject.matte if subject.metadata.over_black else np.ones_like(subject.matte)
    share = person.samples.matte / np.maximum(warped(matte), _LEAST_MATTE)
    placed = np.stack([warped(each) * share[..., None] for each in relit])
    motion, _ = align_to_prediction(placed.mean(axis=0), truth.mean(axis=0), person.samples.matte)
    return np.stack([apply_alignment(each, motion) for each in placed])


_LEAST_MATTE = 0.2
"""Where a subject's matte is less, its pictures are not brightened further."""


def _mean(figures: Mapping[str, float]) -> float:
    return float(np.mean(list(figures.values()))) if figures else float("nan")
