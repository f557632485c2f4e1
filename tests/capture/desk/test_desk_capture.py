"""Desk recordings of a person whose truth is a formula: what is measured, and what is refused in one clear line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.color import luminance
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.rotations import Rotation
from relit_camera.capture.desk import desk_capture
from relit_camera.capture.desk.desk_capture import (
    fit_field,
    identify_patterns,
    measure_desk_samples,
)
from relit_camera.capture.desk.desk_recording import DeskRecording
from relit_camera.capture.desk.patterns.pattern_sequence import Pattern, pattern_lights, standard_sequence
from relit_camera.capture.desk.person import desk_face
from relit_camera.capture.desk.person.desk_face import PUPIL_DISTANCE_CM, find_face, find_mesh_landmarks
from relit_camera.face.detection.face_detector import Box, Detection
from relit_camera.face.head_pose import HeadPose
from relit_camera.lab.evaluate.desk_simulation import SimulatedPerson
from tests.capture.desk.desk_person import SETUP, WEBCAM, LambertianField, face_landmarks, film, lambertian_person

NO_EYES = "the whites of your eyes are not seen: your skin is taken to be neither light nor dark"


@pytest.fixture(autouse=True)
def no_networks(monkeypatch: pytest.MonkeyPatch) -> None:
    """An ellipsoid is no person to a network: the face is stated, the matte is found by the screen's light."""
    monkeypatch.setattr(desk_capture, "segment_person", lambda picture: None)
    monkeypatch.setattr(desk_capture, "find_mesh_landmarks", lambda picture: None)


@pytest.fixture(scope="module")
def person() -> SimulatedPerson:
    return lambertian_person()


@pytest.fixture(scope="module")
def recording(person: SimulatedPerson) -> DeskRecording:
    return film(person)


def patterns_of(recording: DeskRecording) -> list[int]:
    lights = pattern_lights(recording.setup.patterns, recording.setup.patches.count)
    return identify_patterns(recording, lights).patterns.tolist()


def without(recording: DeskRecording, left_out: Sequence[int]) -> DeskRecording:
    frames = [recording.frames[k] for k in range(len(recording.frames)) if k not in left_out]
    return replace(recording, frames=frames)


@pytest.mark.slow
def test_each_pattern_is_told_in_the_pictures(recording: DeskRecording) -> None:
    count = len(recording.setup.patterns)
    assert patterns_of(recording) == list(range(count))


@pytest.mark.slow
def test_no_clock_is_trusted(recording: DeskRecording) -> None:
    """Frames that were dropped and repeated, and others before and after the patterns."""
    random = np.random.default_rng(1)
    frames = [recording.frames[0]] * 11
    for index in range(len(recording.frames)):
        frames += [recording.frames[index]] * int(random.choice([0, 1, 1, 1, 2], p=[0.1, 0.3, 0.3, 0.2, 0.1]))
    found = patterns_of(replace(recording, frames=frames))
    assert sorted(set(found)) == found
    assert len(found) >= len(recording.setup.patterns) - 1


@pytest.mark.slow
def test_normals_and_skin_of_the_person_come_back(recording: DeskRecording, person: SimulatedPerson) -> None:
    found = measure_desk_samples(recording)
    assert found.warnings == [NO_EYES]
    _, samples = fit_field(found)
    assert isinstance(person.field, LambertianField)
    frames, size = recording.size, samples.matte.shape[0]
    # The crop shows 28 cm about the face; the person's own picture has another scale.
    scale = 4 * 7 / size
    points = (np.mgrid[:size, :size] + 0.5 - size / 2) * scale
    points[0] += 0.2 * 7
    row = np.clip(person.face[1] + points[0] * person.pixels_per_cm, 0, 95).astype(int)
    column = np.clip(person.face[0] + points[1] * person.pixels_per_cm, 0, 95).astype(int)
    truth = person.field.normals.reshape(96, 96, 3)[row, column]
    on_face = np.hypot(points[0], points[1]) < 5
    angles = np.degrees(np.arccos(np.clip((samples.geometry.normals * truth).sum(axis=2), -1, 1)))
    assert frames == WEBCAM.size
    assert np.median(angles[on_face]) < 4
    matte = person.matte[row, column]
    assert np.mean(np.abs(samples.matte - matte)[np.abs(points[0]) < 9]) < 0.06


@pytest.mark.slow
def test_dark_skin_stays_dark(monkeypatch: pytest.MonkeyPatch) -> None:
    """The exposure makes both equally bright; the whites of the eyes tell them apart."""
    monkeypatch.setattr(desk_capture, "find_mesh_landmarks", lambda picture: face_landmarks(len(picture)))
    told, fitted = [], []
    for skin in (1.0, 0.4):
        found = measure_desk_samples(film(lambertian_person(skin, eye_whites=0.3)))
        assert NO_EYES not in found.warnings
        _, samples = fit_field(found)
        told.append(found.skin_luminance)
        fitted.append(float(np.median(luminance(samples.geometry.albedo)[found.head.skin])))
    assert told[1] / told[0] == pytest.approx(0.4**1.25, rel=0.15)
    assert fitted[1] / fitted[0] == pytest.approx(told[1] / told[0], rel=0.1)
    assert 0.15 < fitted[0] < 0.45


@pytest.mark.parametrize(
    ("visible", "yaw_deg", "words"),
    [(True, 0, None), (True, 30, None), (True, 60, "away from the webcam by 60 degrees"), (False, 0, "from the side")],
)
def test_a_face_from_the_side_is_refused(
    monkeypatch: pytest.MonkeyPatch, visible: bool, yaw_deg: float, words: str | None
) -> None:
    pose = HeadPose(Rotation.from_rotvec([0, np.radians(yaw_deg), 0]), np.array([0.0, 0.0, -60.0]), 640.0)
    state = SimpleNamespace(visible=visible, pose=pose, landmarks=np.zeros((478, 2), np.float32))
    monkeypatch.setattr(desk_face, "open_tracker", lambda name, options: None)
    monkeypatch.setattr(desk_face, "track_still", lambda picture, tracker: state)
    picture = np.zeros((480, 640, 3), np.uint8)
    if words is None:
        assert find_mesh_landmarks(picture) is state.landmarks
    else:
        with pytest.raises(CaptureError, match=words):
            find_mesh_landmarks(picture)


@pytest.mark.slow
def test_a_head_that_moves_is_aligned(person: SimulatedPerson) -> None:
    moving = replace(WEBCAM, motion_mm=2.5, frames_a_pattern=4, fade_frames=1)
    shifts = measure_desk_samples(film(person, webcam=moving)).samples.pictures
    still = measure_desk_samples(film(person, webcam=replace(moving, motion_mm=0))).samples.pictures
    inner = np.s_[:, 80:-80, 80:-80]
    error = np.abs(shifts[inner] - still[inner]).mean() / still[inner].mean()
    assert error < 0.06


@pytest.mark.slow
def test_the_picture_in_the_room_s_light_is_laid_on_the_others(person: SimulatedPerson) -> None:
    """In a room so dark that the frames before black show nothing of it."""
    webcam = replace(WEBCAM, room=0.001)
    found = measure_desk_samples(film(person, webcam=webcam))
    assert not found.room.any()
    recording = film(person, webcam=webcam, room_picture=True)
    assert recording.room is not None
    moved = replace(recording, room=np.roll(recording.room, 5, axis=1))
    skin = found.head.skin
    details = []
    for shown in (recording, moved):
        seen = measure_desk_samples(shown).room
        gray = np.log(luminance(seen) + 0.05)
        details.append(gray[skin] - gray[skin].mean())
    assert np.corrcoef(*details)[0, 1] > 0.97


@pytest.mark.slow
@pytest.mark.parametrize("turned", ["mirrored", "upside down", "turned by half"])
def test_a_turned_screen_is_refused(person: SimulatedPerson, turned: str) -> None:
    grid = SETUP.patches
    order = np.arange(grid.count).reshape(grid.rows, grid.columns)
    order = {"mirrored": order[:, ::-1], "upside down": order[::-1], "turned by half": order[::-1, ::-1]}[turned]

    def turn(pattern: Pattern) -> Pattern:
        return pattern if isinstance(pattern, str) else [pattern[k] for k in order.ravel()]

    shown = SETUP.model_copy(update={"sequence": [turn(pattern) for pattern in SETUP.patterns]})
    with pytest.raises(CaptureError, match=turned):
        patterns_of(film(person, shown, said=SETUP))


def wall_alone(frame: DisplayImage) -> DisplayImage:
    """The frame without the person."""
    wall = np.median(frame[:20, :20].reshape(-1, 3), axis=0)
    noise = np.random.default_rng(int(frame.sum())).normal(0, WEBCAM.noise, frame.shape)
    return np.clip(wall + noise, 0, 255).astype(np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize(("begins", "ends"), [(0.25, 1.0), (0.5, 1.0), (0.75, 1.0), (0.45, 0.6)])
def test_a_person_who_leaves_midway_is_told(recording: DeskRecording, begins: float, ends: float) -> None:
    count = len(recording.frames)
    away = range(round(begins * count), round(ends * count))
    frames = [wall_alone(recording.frames[k]) if k in away else recording.frames[k] for k in range(count)]
    with pytest.raises(CaptureError, match=r"you are not seen under \d+ of \d+ patterns.*stay before the webcam"):
        measure_desk_samples(replace(recording, frames=frames))


class FoundFaces:
    """A detector that finds these faces in every picture."""

    def __init__(self, *boxes: Box) -> None:
        self.boxes = boxes

    def detect_all(self, picture: DisplayImage) -> list[Detection]:
        return [
            Detection((x, y, w, h), np.array([[x + 0.3 * w, y + 0.4 * h], [x + 0.7 * w, y + 0.4 * h]], np.float32), 0.9)
            for x, y, w, h in self.boxes
        ]


FACE: Box = (150, 90, 100, 120)


@pytest.mark.parametrize(
    ("boxes", "message"),
    [
        ([], "no face is seen under the white screen; sit before the webcam"),
        ([FACE, (10, 90, 80, 100)], "two faces are seen; only you may be in the picture"),
        ([(150, 90, 60, 70)], "only 70 pixels high"),
    ],
)
def test_no_face_two_and_a_small_one_are_told(
    recording: DeskRecording, monkeypatch: pytest.MonkeyPatch, boxes: list[Box], message: str
) -> None:
    monkeypatch.setattr(desk_face, "open_face_detector", lambda: FoundFaces(*boxes))
    searched = replace(recording, setup=recording.setup.model_copy(update={"face": None, "pixels_per_cm": None}))
    with pytest.raises(CaptureError, match=message):
        measure_desk_samples(searched)


def test_a_small_face_in_the_background_is_nobody(recording: DeskRecording, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(desk_face, "open_face_detector", lambda: FoundFaces((10, 10, 30, 40), FACE))
    setup = recording.setup.model_copy(update={"face": None, "pixels_per_cm": None})
    found = find_face(recording.frames[0], setup)
    assert (found.circle.x, found.circle.y, found.circle.radius) == (200, 150, 60)
    assert found.pixels_per_cm == pytest.approx(40 / PUPIL_DISTANCE_CM)


def test_a_still_picture_shows_no_patterns(recording: DeskRecording) -> None:
    still = replace(recording, frames=[recording.frames[0]] * 60)
    with pytest.raises(CaptureError, match="no patterns are seen"):
        measure_desk_samples(still)


@pytest.mark.slow
def test_a_bright_room_drowns_the_patterns(person: SimulatedPerson) -> None:
    with pytest.raises(CaptureError, match="patterns are"):
        measure_desk_samples(film(person, webcam=replace(WEBCAM, room=100.0)))


def test_a_page_that_is_closed_midway_is_told(recording: DeskRecording) -> None:
    half = without(recording, range(len(recording.frames) // 2, len(recording.frames)))
    with pytest.raises(CaptureError, match=r"ends early|frames are missing"):
        measure_desk_samples(half)


def test_missing_patterns_are_told(recording: DeskRecording) -> None:
    sequence = SETUP.patterns
    mixed = [index for index, pattern in enumerate(sequence) if not isinstance(pattern, str)]
    length = WEBCAM.frames_a_pattern + WEBCAM.fade_frames
    gone = [frame for index in mixed[2:5] for frame in range(index * length, (index + 1) * length)]
    with pytest.raises(CaptureError, match="frames are missing"):
        measure_desk_samples(without(recording, gone))


def darken(factor: float) -> DisplayImage:
    return np.clip(np.arange(256) * factor, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("factor", "message"), [(0.12, "too dark"), (3.0, "over-exposed")])
def test_exposure_is_checked(recording: DeskRecording, factor: float, message: str) -> None:
    table = darken(factor)
    frames = [table[recording.frames[k]] for k in range(len(recording.frames))]
    with pytest.raises(CaptureError, match=message):
        measure_desk_samples(replace(recording, frames=frames))


@pytest.mark.slow
def test_automatic_exposure_is_refused_and_changing_color_noted(person: SimulatedPerson) -> None:
    length = (WEBCAM.frames_a_pattern + WEBCAM.fade_frames) * len(SETUP.patterns)

    def brighter(index: int, frame: DisplayImage) -> DisplayImage:
        return np.minimum(frame * (1 + 0.35 * index / length), 255).astype(np.uint8)

    def warmer(index: int, frame: DisplayImage) -> DisplayImage:
        return (frame * (1, 1, 1 - 0.08 * index / length)).astype(np.uint8)

    dim = replace(WEBCAM, exposure=0.4)
    with pytest.raises(CaptureError, match="times the light later on"):
        measure_desk_samples(film(person, webcam=dim, change=brighter))
    warnings = measure_desk_samples(film(person, webcam=dim, change=warmer)).warnings
    assert any("color of the same white" in warning for warning in warnings)


def test_a_small_face_is_refused(person: SimulatedPerson) -> None:
    with pytest.raises(CaptureError, match="pixels high"):
        measure_desk_samples(film(person, webcam=replace(WEBCAM, size=(240, 180))))


@pytest.mark.slow
def test_one_patch_at_a_time_works_too(person: SimulatedPerson) -> None:
    slow = SETUP.model_copy(update={"sequence": standard_sequence(3, 2, one_by_one=True)})
    recording = film(person, slow)
    assert patterns_of(recording) == list(range(len(slow.patterns)))
