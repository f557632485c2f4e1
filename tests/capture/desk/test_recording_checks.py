"""What a recording's light and sizes tell of the screen, the webcam and the distance: warnings that do not stop it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.capture.desk import desk_capture
from relit_camera.capture.desk.desk_capture import measure_desk_samples
from relit_camera.capture.desk.person.desk_face import DeskFace
from relit_camera.capture.desk.recording_checks import linearity_warnings, scale_warnings
from relit_camera.capture.film.face_circle import FaceCircle
from tests.capture.desk.desk_person import SETUP, WEBCAM, film, lambertian_person

PATCHES = np.tile(np.array([0.2, 0.1, 0.05], np.float32), (6, 1))
"""Means (patches, 3) of a face, each patch alone."""
ROOM = np.array([0.03, 0.03, 0.02], np.float32)
WIDTH = 640
EYES_TOLD = ["the whites of your eyes are not seen: your skin is taken to be neither light nor dark"]


def whites(share: float) -> list[np.ndarray]:
    """Two means (3,) under white, where white has this share of the patches' light."""
    return [share * PATCHES.sum(axis=0) + ROOM] * 2


@pytest.mark.parametrize("share", [0.9, 1.0, 1.1])
def test_patches_that_add_up_to_white_are_no_news(share: float) -> None:
    assert linearity_warnings(PATCHES, whites(share), ROOM) == []


@pytest.mark.parametrize(("share", "times"), [(0.5, "2.00"), (0.8, "1.25"), (1.25, "0.80")])
def test_a_screen_that_dims_its_white_or_its_patches_is_told(share: float, times: str) -> None:
    (warning,) = linearity_warnings(PATCHES, whites(share), ROOM)
    assert warning.startswith(f"all patches together give {times} times the light of white: local dimming, HDR")


def test_without_a_white_pattern_nothing_can_be_compared() -> None:
    assert linearity_warnings(PATCHES, [], ROOM) == []
    assert linearity_warnings(PATCHES, [ROOM], ROOM) == [], "a white that is black is told elsewhere"


@pytest.mark.parametrize(
    ("distance_cm", "pixels_per_cm", "fits"),
    [(60, 640 / 60, True), (60, 5.0, True), (60, 4.0, False), (60, 23.0, True), (60, 24.0, False), (150, 10.0, False)],
)
def test_a_face_that_is_as_large_as_at_another_distance_is_told(
    distance_cm: float, pixels_per_cm: float, fits: bool
) -> None:
    """Webcams have focal lengths between 0.45 and 2.2 widths of their picture."""
    face = DeskFace(FaceCircle(320, 240, 80), pixels_per_cm)
    told = scale_warnings(face, SETUP.model_copy(update={"distance_cm": distance_cm}), WIDTH)
    what = f"the face is as large as at another distance than {distance_cm} cm: measure from eyes to screen"
    assert told == ([] if fits else [what])


@pytest.fixture
def no_networks(monkeypatch: pytest.MonkeyPatch) -> None:
    """An ellipsoid is no person to a network."""
    monkeypatch.setattr(desk_capture, "segment_person", lambda picture: None)
    monkeypatch.setattr(desk_capture, "find_mesh_landmarks", lambda picture: None)


@pytest.mark.slow
@pytest.mark.usefixtures("no_networks")
def test_both_are_told_of_a_whole_recording() -> None:
    """Before a screen whose white has 70 % of the light of all its patches, and at a distance that is wrong."""
    length = WEBCAM.frames_a_pattern + WEBCAM.fade_frames

    def dimmed(index: int, frame: DisplayImage) -> DisplayImage:
        white = SETUP.patterns[index // length] == "white"
        return uint8_from_linear(linear_from_uint8(frame) * np.float32(0.7)) if white else frame

    said = SETUP.model_copy(update={"distance_cm": 140})
    calm = replace(WEBCAM, noise=1)
    recording = film(lambertian_person(), webcam=calm, change=dimmed)
    told = measure_desk_samples(recording).warnings
    (warning,) = [each for each in told if each not in EYES_TOLD]
    times = re.match(r"all patches together give ([0-9.]+) times the light of white", warning)
    assert times is not None, warning
    assert float(times[1]) == pytest.approx(1 / 0.7, rel=0.03)
    recording = film(lambertian_person(), said=said, webcam=calm)
    told = measure_desk_samples(recording).warnings
    assert "the face is as large as at another distance than 140 cm: measure from eyes to screen" in told
