"""The live face is looked at while it is followed, and nothing is known without the network."""

from __future__ import annotations

from typing import cast

import numpy as np

from relit_camera.base.errors import ModelError
from relit_camera.face.identity.face_embedder import FaceEmbedder
from relit_camera.face.identity.identity_judge import Verdict
from relit_camera.face.identity.live_identity import LiveIdentity
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.subject.subject import Subject

SCHEME = landmark_scheme("mesh478")
IMAGE = np.zeros((48, 64, 3), np.uint8)
POINTS = np.zeros((SCHEME.count, 2), np.float32)
ME, YOU, UNMARKED = (cast(Subject, name) for name in ("me", "you", "unmarked"))
PLACES = {"me": 0.0, "you": 1.0}


class Embedder(FaceEmbedder):
    """People stand on a line; `before` is who is before the camera."""

    def __init__(self) -> None:
        self.before, self.looks = 0.0, 0

    def embed(self, *_: object) -> np.ndarray:
        self.looks += 1
        return np.eye(1, 128, dtype=np.float32)[0] * np.float32(self.before)

    def reference_embedding(self, subject: Subject) -> np.ndarray | None:
        place = PLACES.get(str(subject))
        return None if place is None else np.eye(1, 128, dtype=np.float32)[0] * np.float32(place)


def watched(
    identity: LiveIdentity,
    subject: Subject,
    start_s: float,
    seconds: float,
    followed: bool = True,
    plain: bool = True,
) -> Verdict:
    """The verdict after so long at 30 frames a second."""
    for step in range(int(30 * seconds)):
        last = identity.verdict(subject, IMAGE, POINTS if followed else None, plain, start_s + step / 30)
    return last


def test_one_s_own_and_another_s_face_are_told_after_some_looks() -> None:
    embedder = Embedder()
    identity = LiveIdentity(lambda: embedder, SCHEME)
    assert identity.verdict(ME, IMAGE, POINTS, True, 0.0) is Verdict.UNKNOWN
    assert watched(identity, ME, 0.0, 2.0) is Verdict.SAME
    assert watched(identity, YOU, 2.0, 0.1) is Verdict.OTHER  # by the looks that are known
    assert embedder.looks < 10
    assert watched(identity, UNMARKED, 2.1, 2.0) is Verdict.UNKNOWN


def test_whoever_comes_after_a_while_is_looked_at_anew() -> None:
    embedder = Embedder()
    identity = LiveIdentity(lambda: embedder, SCHEME)
    assert watched(identity, ME, 0.0, 2.0) is Verdict.SAME
    assert watched(identity, ME, 2.0, 2.0, followed=False) is Verdict.SAME  # nothing new is known
    embedder.before = PLACES["you"]
    assert identity.verdict(ME, IMAGE, POINTS, True, 4.0) is Verdict.UNKNOWN
    assert watched(identity, ME, 4.0, 2.0) is Verdict.OTHER


def test_who_looks_aside_for_long_is_still_the_same() -> None:
    embedder = Embedder()
    identity = LiveIdentity(lambda: embedder, SCHEME)
    assert watched(identity, YOU, 0.0, 2.0) is Verdict.OTHER
    looks = embedder.looks
    assert watched(identity, YOU, 2.0, 5.0, plain=False) is Verdict.OTHER
    assert embedder.looks == looks


def test_without_the_network_nothing_is_known_and_it_is_looked_for_once() -> None:
    asked = []

    def missing() -> FaceEmbedder:
        asked.append(1)
        raise ModelError("model face_embedding is not pulled", "relit models pull")

    identity = LiveIdentity(missing, SCHEME)
    assert watched(identity, ME, 0.0, 2.0) is Verdict.UNKNOWN
    assert len(asked) == 1
