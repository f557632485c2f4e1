"""The face in the subject's still: where its landmarks are and how the head stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.errors import SubjectError
from relit_camera.face.landmarks import Scheme
from relit_camera.face.pose import fit_pose, unproject
from relit_camera.face.schemes import landmark_scheme
from relit_camera.face.state import HeadPose, Tracker
from relit_camera.face.still import look_at
from relit_camera.face.trackers import open_tracker
from relit_camera.space.images import Points
from relit_camera.subject.subject import Subject

SCHEME_TRACKERS = {"mesh478": "mesh", "openseeface66": "openseeface"}
"""Who finds the landmarks of a scheme in a picture."""


@dataclass(frozen=True)
class SourceFace:
    """The still's face.

    Attributes:
        scheme: the landmark scheme.
        landmarks: (count, 2) float32 pixels of the still.
        pose: of the head in the still, relative to the camera.
        head_points: (count, 3) float64 centimetres: the landmarks in head axes.
        size: (width, height) of the still.
    """

    scheme: Scheme
    landmarks: Points
    pose: HeadPose
    head_points: NDArray[np.float64]
    size: tuple[int, int]


def source_face(subject: Subject, tracker: Tracker) -> SourceFace:
    """Find the face in the subject's still: as `tracker` sees it, where it is to be compared with what it sees live.

    Where it is a recording, or finds none, the landmarks stored with the subject count: models and people who mark
    faces do not mean quite the same points.

    Raises:
        SubjectError: the subject keeps no landmarks of the tracker's scheme and the tracker finds no face in it.
        ModelError: a recorded track is played back, the subject keeps no landmarks, and the models are missing.
    """
    scheme = landmark_scheme(tracker.scheme)
    recorded = tracker.name == "recorded"
    landmarks = None if recorded else _seen(subject, tracker)
    if landmarks is None:
        landmarks = subject.landmarks.get(scheme.name)
    if landmarks is None and recorded:
        # A recording has not seen the still; the tracker that gives such landmarks finds them.
        landmarks = _seen(subject, open_tracker(SCHEME_TRACKERS[scheme.name]))
    if landmarks is None:
        raise SubjectError(
            f"tracker '{tracker.name}' finds no face in the subject's still",
            "choose a subject whose face looks into the camera, or another tracker",
        )
    if len(landmarks) != scheme.count:
        raise SubjectError(
            f"the subject keeps {len(landmarks)} landmarks of scheme '{scheme.name}', which has {scheme.count}",
            "build the subject again",
        )
    pose = fit_pose(landmarks, scheme, subject.size)
    if pose is None:
        raise SubjectError("no head pose fits the landmarks of the subject's face", "build the subject again")
    return SourceFace(scheme, landmarks, pose, unproject(landmarks, pose, scheme, subject.size), subject.size)


def _seen(subject: Subject, tracker: Tracker) -> Points | None:
    state = look_at(subject.neutral, tracker)
    return state.landmarks if state.visible else None
