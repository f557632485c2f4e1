"""Aligning faces, and the embeddings of rendered people."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.app.demo import demo_files
from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.base.models.model_store import FOLDER_VARIABLE, ModelState, ModelStore
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.face.identity.face_embedder import (
    MODEL,
    REFERENCE_POINTS,
    SIDE_PX,
    Embedding,
    FaceEmbedder,
    aligned_crop,
)
from relit_camera.face.identity.identity_judge import JudgeTunables
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.tracking.track_recording import read_track
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_file import read_subject
from tests.made_once import made_once
from tests.replay.materials import mannequin

SCHEMES = ("mesh478", "openseeface66")
MESH = landmark_scheme("mesh478")
SAME_PERSON = JudgeTunables().distance


def points_of(landmarks: Points, scheme: LandmarkScheme) -> Points:
    """The five points by which a face is aligned."""
    corners = landmarks[[scheme.upper_lip_outer[0], scheme.upper_lip_outer[-1]]]
    return np.concatenate([scheme.eye_centers(landmarks), landmarks[[scheme.nose_tip]], corners])


def ideal_landmarks(scheme: LandmarkScheme) -> Points:
    """Landmarks whose five points lie on `REFERENCE_POINTS`; the others somewhere."""
    landmarks = np.random.default_rng(0).uniform(0, SIDE_PX, (scheme.count, 2))
    for eye, place in zip((scheme.right_eye, scheme.left_eye), REFERENCE_POINTS[:2], strict=True):
        landmarks[[eye.outer, eye.inner]] = place + np.array([[-9, 2], [9, -2]])
    landmarks[[scheme.nose_tip, scheme.upper_lip_outer[0], scheme.upper_lip_outer[-1]]] = REFERENCE_POINTS[2:]
    return landmarks.astype(np.float32)


def moved(points: Points, scale: float, angle: float, shift: tuple[float, float]) -> Points:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(scale * points @ turn.T + shift, np.float32)


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("angle", [0.0, 0.4, -2.9])
def test_a_face_that_is_turned_shifted_and_scaled_comes_to_its_place(name: str, angle: float) -> None:
    scheme = landmark_scheme(name)
    landmarks = moved(ideal_landmarks(scheme), 2.3, angle, (310.0, -40.0))
    crop = aligned_crop(landmarks, scheme)
    assert crop.width == crop.height == pytest.approx(2.3 * SIDE_PX)
    back = crop.to_picture(REFERENCE_POINTS.astype(np.float32), SIDE_PX, SIDE_PX)
    np.testing.assert_allclose(back, points_of(landmarks, scheme), atol=1e-2)


def test_no_other_similarity_is_nearer() -> None:
    rng = np.random.default_rng(1)
    landmarks = moved(ideal_landmarks(MESH), 1.7, 0.2, (200.0, 90.0))
    landmarks += rng.normal(0, 8, landmarks.shape).astype(np.float32)
    crop, points = aligned_crop(landmarks, MESH), points_of(landmarks, MESH)

    def error(center: tuple[float, float], side: float, angle: float) -> float:
        other = replace(crop, center=center, width=side, height=side, angle=angle)
        placed = other.to_picture(REFERENCE_POINTS.astype(np.float32), SIDE_PX, SIDE_PX)
        return float(((placed - points) ** 2).sum())

    best = error(crop.center, crop.width, crop.angle)
    assert best > 10
    for dx, dy, stretch, turn in rng.normal(0, (2, 2, 0.02, 0.02), (50, 4)):
        center = (crop.center[0] + dx, crop.center[1] + dy)
        assert error(center, crop.width * (1 + stretch), crop.angle + turn) > best


def test_landmarks_that_are_all_in_one_place_are_no_fault() -> None:
    crop = aligned_crop(np.full((MESH.count, 2), 50, np.float32), MESH)
    assert crop.cut(np.zeros((100, 100, 3), np.uint8), SIDE_PX, SIDE_PX).shape == (SIDE_PX, SIDE_PX, 3)


def test_both_schemes_mean_the_same_face(person: Subject) -> None:
    mesh, other = (aligned_crop(person.landmarks[name], landmark_scheme(name)) for name in SCHEMES)
    assert other.width == pytest.approx(mesh.width, rel=0.05)
    assert np.hypot(*np.subtract(mesh.center, other.center)) < 0.02 * mesh.width


def test_without_the_network_it_says_how_to_get_it(tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(tmp_path_factory.mktemp("none")))
        with pytest.raises(ModelError, match="run `relit models pull face_embedding`"):
            FaceEmbedder()


@pytest.fixture(scope="module")
def person() -> Subject:
    return read_subject(demo_files.SUBJECT)


@pytest.fixture(scope="module")
def embedder() -> FaceEmbedder:
    """Where the network is neither pulled nor to be had, the test is skipped."""
    store = ModelStore()
    if store.state(MODEL) is not ModelState.PULLED:
        try:
            makers = ("service/relit_camera/base/models",)
            store = ModelStore(made_once("face-embedding", lambda folder: ModelStore(folder).pull([MODEL]), makers))
        except ModelError as error:
            pytest.skip(str(error))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(store.folder))
        return FaceEmbedder()


def distance(a: Embedding, b: Embedding) -> float:
    return float(np.linalg.norm(a - b))


def looks_at(embedder: FaceEmbedder, clip: str) -> list[Embedding]:
    """Looks at the people of films whose tracks are known: the bundled person, or the generated mannequin."""
    video, track = (demo_files.CLIP, demo_files.TRACK)
    if clip == "mannequin":
        video, track = mannequin() / "clip.mp4", mannequin() / "track.json"
    recorded, looks = read_track(track), []
    with VideoReader(video, accurate=False) as frames:
        for frame in frames:
            state = recorded.state(frame.index)
            if frame.index % 12 == 0 and state.visible:
                looks.append(embedder.embed(frame.image, state.landmarks, landmark_scheme(state.scheme)))
    return looks


def relit(person: Subject, texels: slice) -> DisplayImage:
    """The person under light from some columns of the light map alone."""
    light = np.zeros((32, 64), np.float32)
    light[4:20, texels] = 1
    picture = person.pictures(person.coefficients @ light.reshape(-1, 1))[0]
    return np.asarray(255 * np.clip(picture / np.quantile(picture, 0.97), 0, 1) ** (1 / 2.2), np.uint8)


def test_a_person_in_two_lights_is_the_same(embedder: FaceEmbedder, person: Subject) -> None:
    embed = partial(embedder.embed, landmarks=person.landmarks["mesh478"], scheme=MESH)
    left, right = (relit(person, slice(first, first + 16)) for first in (12, 36))
    assert np.abs(left.astype(float) - right).mean() > 20
    assert distance(embed(left), embed(right)) < SAME_PERSON


@pytest.mark.slow
def test_the_bundled_person_is_known_by_their_subject_and_the_mannequin_is_not(
    embedder: FaceEmbedder, person: Subject
) -> None:
    reference = embedder.reference_embedding(person)
    assert reference is not None
    own, others = ([distance(look, reference) for look in looks_at(embedder, clip)] for clip in ("own", "mannequin"))
    assert max(own) < SAME_PERSON
    assert np.median(others) > SAME_PERSON


def test_size_place_and_roll_change_little(embedder: FaceEmbedder, person: Subject) -> None:
    reference = embedder.reference_embedding(person)
    assert reference is not None
    turn = cv2.getRotationMatrix2D((190, 190), 25, 0.7)
    turned: NDArray[np.uint8] = cv2.warpAffine(person.neutral, turn, (400, 380))
    landmarks = np.asarray(person.landmarks["mesh478"] @ turn[:, :2].T + turn[:, 2], np.float32)
    assert distance(embedder.embed(turned, landmarks, MESH), reference) < 0.5 * SAME_PERSON


def test_the_embedding_of_a_subject_is_made_once(embedder: FaceEmbedder, person: Subject) -> None:
    reference = embedder.reference_embedding(person)
    assert reference is not None
    assert reference.shape == (128,)
    assert reference.dtype == np.float32
    assert embedder.reference_embedding(person) is reference
    other = replace(person, neutral=np.ascontiguousarray(person.neutral[::-1]))
    changed = embedder.reference_embedding(other)
    assert changed is not None
    assert distance(changed, reference) > 0.1
    assert embedder.reference_embedding(replace(person, landmarks={})) is None
