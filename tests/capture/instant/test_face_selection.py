"""Which moments of a person a subject is made of: a head that is drawn, with expressions made of its landmarks."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.capture.instant import face_selection
from relit_camera.capture.instant.face_selection import SCHEME, FaceSelection, select_faces
from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.face_state import LOST, FaceState, FaceStatus
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from tests.capture.instant.canonical_person import canonical_landmarks, canonical_pose

SIZE = 200
HEIGHT_CM = 18.1
"""Of the canonical face, from forehead to chin."""
MESH = landmark_scheme(SCHEME)
Moment = tuple[DisplayImage, FaceState]


class FakeDetector:
    """Finds faces of these heights in every picture."""

    def __init__(self, heights: Sequence[float]) -> None:
        self.heights = heights

    def detect_all(self, image: DisplayImage) -> list[Detection]:
        return [Detection((0, 0, height, height), np.zeros((2, 2), np.float32), 1.0) for height in self.heights]


@pytest.fixture(autouse=True)
def others(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Heights of all faces in the pictures, to be changed."""
    heights = [100.0]
    monkeypatch.setattr(face_selection, "open_face_detector", lambda: FakeDetector(heights))
    return heights


def textured(seed: int = 0) -> DisplayImage:
    """A picture with detail in which left and right are alike."""
    half = np.random.default_rng(seed).integers(60, 200, (SIZE // 4, SIZE // 8, 3), np.uint8)
    return np.asarray(cv2.resize(np.hstack([half, half[:, ::-1]]), (SIZE, SIZE)), np.uint8)


def moment(
    yaw_deg: float = 0,
    height_px: float = 100,
    wide: float = 1.0,
    opened: float = 0.0,
    blink: float = 0.0,
    shift: float = 0.0,
    image: DisplayImage | None = None,
    seed: int = 0,
) -> Moment:
    """A frame and the face in it.

    Args:
        wide: width of the mouth over that at rest: a pucker, a smile.
        opened: gap between the lips, in eye spans.
        blink: how far the lids are shut, 0..1.
        shift: to the right, in pixels.
        seed: of what the tracker is wrong by.
    """
    pose = canonical_pose(SIZE, yaw_deg, height_px / HEIGHT_CM)
    points = canonical_landmarks(pose, SIZE) + np.random.default_rng(seed).normal(0, 0.1, (478, 2))
    lips = list(MESH.lips)
    middle = points[lips].mean(axis=0)
    points[lips] = middle + (points[lips] - middle) * [wide, 1]
    upper, lower = list(MESH.upper_lip_inner), list(MESH.lower_lip_inner)
    points[upper] = points[lower] = (points[upper] + points[lower]) / 2
    points[list(MESH.lower_lip_inner[1:-1])] += [0, opened * MESH.eye_span(points.astype(np.float32))]
    for eye in (MESH.right_eye, MESH.left_eye):
        lids = points[list(eye.lids)]
        points[list(eye.lids)] = lids + np.array([0, blink]) * (lids.mean(axis=0) - lids)
    seen: Points = (points + [shift, 0]).astype(np.float32)
    eyes, mouth = MESH.eyes_opening(seen), MESH.mouth_opening(seen)
    state = FaceState(FaceStatus.FOUND, 1.0, SCHEME, seen, pose, eyes, mouth)
    return (textured() if image is None else image), state


def chosen(moments: Sequence[Moment]) -> tuple[list[int], tuple[str, ...]]:
    """Indices of the moments that are chosen, the best first, and the warnings."""
    selection: FaceSelection = select_faces([image for image, _ in moments], [state for _, state in moments], "film")
    points = [state.landmarks for _, state in moments]
    return [
        next(i for i, p in enumerate(points) if p is face.landmarks) for face in selection.faces
    ], selection.warnings


@pytest.mark.parametrize("wide", [0.6, 1.35])
def test_a_pucker_or_a_smile_that_comes_and_goes_is_never_chosen(wide: float) -> None:
    film = [moment(opened=0.03, seed=index) if index % 7 else moment(wide=wide, seed=index) for index in range(20)]
    indices, warnings = chosen(film)
    assert len(indices) > 5
    assert all(index % 7 for index in indices)
    assert not warnings


def test_open_eyes_and_a_shut_mouth_are_chosen_though_rare() -> None:
    film = [moment(blink=0.9, seed=1)] * 4 + [moment(opened=0.15, seed=2)] * 4 + [moment(seed=3), moment(seed=4)]
    assert sorted(chosen(film)[0]) == [8, 9]


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        ({"blink": 0.9}, "the eyes are shut"),
        ({"opened": 0.15}, "the mouth is open"),
        ({"yaw_deg": 31.0}, "the face is turned by 31 degrees"),
        ({"height_px": 50.0}, "the face is only 50 pixels high"),
    ],
)
def test_a_source_without_an_ideal_moment_is_used_with_a_warning(shown: dict[str, float], words: str) -> None:
    indices, warnings = chosen([moment(**shown, seed=index) for index in range(4)])  # type: ignore[arg-type]
    assert indices
    assert len(warnings) == 1
    assert words in warnings[0]


@pytest.mark.parametrize(
    ("shown", "words"), [({"yaw_deg": 40.0}, "turned away by 40 degrees"), ({"height_px": 40.0}, "40 pixels high")]
)
def test_what_is_too_small_or_turned_away_is_refused_but_not_one_good_frame(
    shown: dict[str, float], words: str
) -> None:
    poor = [moment(**shown, seed=index) for index in range(3)]  # type: ignore[arg-type]
    with pytest.raises(CaptureError, match=words):
        chosen(poor)
    better = {name: value - 8 if name == "yaw_deg" else value + 8 for name, value in shown.items()}
    assert chosen([*poor, moment(**better)])[0] == [3]  # type: ignore[arg-type]


def test_no_face_is_refused() -> None:
    with pytest.raises(CaptureError, match="no face was found in film"):
        select_faces([textured()], [LOST], "film")


def test_the_frontal_face_is_chosen() -> None:
    assert chosen([moment(yaw_deg=yaw, seed=index) for index, yaw in enumerate([20, 14, 2, 9, 20, 20])])[0][0] == 2


def test_a_sharp_frame_is_chosen_and_blurred_ones_are_left_out() -> None:
    blurred = cv2.GaussianBlur(textured(), (0, 0), 2.5)
    film = [moment(image=np.asarray(blurred, np.uint8), seed=index) for index in range(6)]
    assert sorted(chosen([*film, moment(seed=6), moment(seed=7)])[0]) == [6, 7]


@pytest.mark.parametrize("fault", ["hand", "white", "black"])
def test_a_face_behind_a_hand_or_lost_to_the_light_is_left_out(fault: str) -> None:
    """The hand is as detailed and as bright as the face."""
    spoilt = textured()
    if fault == "hand":
        spoilt[90:150, 60:105] = textured(1)[90:150, 60:105]
    else:
        spoilt[80:130, 70:130] = 255 if fault == "white" else 0
    assert chosen([moment(image=spoilt, seed=1)] * 4 + [moment(seed=2)])[0] == [4]


def test_two_people_are_no_error_and_a_small_second_face_needs_no_word(others: list[float]) -> None:
    others.append(80.0)
    assert chosen([moment()])[1] == ("two people are in the picture: the larger face was taken",)
    others[1] = 30.0
    assert not chosen([moment()])[1]


def test_all_frames_show_one_person() -> None:
    """The tracker goes over to another person, who looks alike, and sits aside, or further away."""
    for other in ({"shift": 120.0}, {"height_px": 55.0}):
        film = [moment(seed=index, **other) for index in range(4)]  # type: ignore[arg-type]
        film += [moment(seed=index) for index in range(4, 10)]
        indices, warnings = chosen(film)
        assert min(indices) >= 4
        assert not warnings
