"""Whether the live face is a subject's, where the network that tells it is installed."""

from __future__ import annotations

from collections.abc import Callable

from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.face.identity.face_embedder import FaceEmbedder
from relit_camera.face.identity.identity_judge import IdentityJudge, PersonTrack, Verdict
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme
from relit_camera.subject.subject import Subject


class LiveIdentity:
    """Judges the face that is followed, frame by frame. Not thread-safe."""

    def __init__(self, open_embedder: Callable[[], FaceEmbedder], scheme: LandmarkScheme) -> None:
        """Set up; the network is opened with the first face.

        Args:
            open_embedder: raises ModelError where the network is missing: then nothing is ever known.
            scheme: of the landmarks.
        """
        self._open_embedder, self._scheme = open_embedder, scheme
        self._embedder: FaceEmbedder | None = None
        self._missing = False
        self._track = PersonTrack()
        self._judge: tuple[Subject, IdentityJudge | None] | None = None

    def verdict(
        self, subject: Subject, image: DisplayImage, landmarks: Points | None, plain: bool, time_s: float
    ) -> Verdict:
        """What is known by now of a live face and a subject.

        Args:
            subject: whose face it might be.
            image: the frame, uint8 sRGB.
            landmarks: of the face in it; None where none is followed.
            plain: whether the face is seen well enough to be looked at.
            time_s: of the frame.
        """
        embedder = self._opened()
        if embedder is None:
            return Verdict.UNKNOWN
        if landmarks is not None:
            self._track.found(time_s)
            if plain and self._track.is_due(time_s):
                self._track.add(embedder.embed(image, landmarks, self._scheme), time_s)
        if self._judge is None or self._judge[0] is not subject:
            reference = embedder.reference_embedding(subject)
            self._judge = subject, None if reference is None else IdentityJudge(self._track, reference)
        judge = self._judge[1]
        return Verdict.UNKNOWN if judge is None else judge.judge()

    def _opened(self) -> FaceEmbedder | None:
        if self._embedder is None and not self._missing:
            try:
                self._embedder = self._open_embedder()
            except ModelError:
                self._missing = True
        return self._embedder
