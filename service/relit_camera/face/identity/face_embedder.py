"""Face embeddings: vectors that lie near each other where two pictures show one person, whatever the light.

The network is dlib's (docs/models.md).
"""

from __future__ import annotations

import math
import weakref

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import NotFoundError
from relit_camera.base.images.image_types import DisplayImage, Points
from relit_camera.base.models.model_store import model_path
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.landmarks.rotated_crop import Crop
from relit_camera.subject.subject import Subject

MODEL = "face_embedding"

Embedding = NDArray[np.float32]
"""(128,) float32; people are compared by the Euclidean distance."""

SIDE_PX = 150
REFERENCE_POINTS = np.array([[47.8, 47.4], [100.2, 47.4], [74.0, 76.6], [50.4, 103.0], [97.6, 103.0]])
"""Where the network wants the middles of the right and left eye, the nose's tip and the right and left mouth corner.

dlib's mean face in a picture of `SIDE_PX` with a margin of a quarter (dlib, image_transforms/interpolation.h).
"""


class FaceEmbedder:
    """Makes embeddings. Not thread-safe."""

    def __init__(self, options: SessionOptions | None = None) -> None:
        """Open the network.

        Raises:
            ModelError: it is missing.
        """
        self._session = open_session(model_path(MODEL), MODEL, options)
        self._reference: tuple[weakref.ref[Subject], Embedding | None] | None = None

    def embed(self, image: DisplayImage, landmarks: Points, scheme: LandmarkScheme) -> Embedding:
        """The embedding of the face that has these landmarks in `image`."""
        face = aligned_crop(landmarks, scheme).cut(image, SIDE_PX, SIDE_PX)
        pixels = np.divide(face[None], 255, dtype=np.float32)
        return np.asarray(self._session.run({"image": pixels})["embedding"][0], np.float32)

    def reference_embedding(self, subject: Subject) -> Embedding | None:
        """The embedding of the subject in their source image; None where the subject keeps no landmarks.

        It is kept until another subject is asked for.
        """
        if self._reference is None or self._reference[0]() is not subject:
            self._reference = weakref.ref(subject), self._embed_subject(subject)
        return self._reference[1]

    def _embed_subject(self, subject: Subject) -> Embedding | None:
        for name, landmarks in subject.landmarks.items():
            try:
                scheme = landmark_scheme(name)
            except NotFoundError:  # of a tracker that is not here
                continue
            if len(landmarks) == scheme.count:
                return self.embed(subject.neutral, landmarks, scheme)
        return None


def aligned_crop(landmarks: Points, scheme: LandmarkScheme) -> Crop:
    """The square of the picture in which a face's points lie nearest, in least squares, to `REFERENCE_POINTS`."""
    corners = landmarks[[scheme.upper_lip_outer[0], scheme.upper_lip_outer[-1]]]
    points = np.concatenate([scheme.eye_centers(landmarks), landmarks[[scheme.nose_tip]], corners]).astype(np.float64)
    middle, goal = REFERENCE_POINTS.mean(axis=0), points.mean(axis=0)
    # As complex numbers a similarity is one factor, and least squares a quotient.
    reference, found = (REFERENCE_POINTS - middle) @ [1, 1j], (points - goal) @ [1, 1j]
    factor = np.vdot(reference, found) / np.vdot(reference, reference).real
    center = (SIDE_PX / 2 - middle) @ [1, 1j] * factor + goal @ [1, 1j]
    side = SIDE_PX * max(abs(factor), 1e-6)
    return Crop((center.real, center.imag), side, side, math.atan2(factor.imag, factor.real))
