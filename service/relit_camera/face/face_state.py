"""The state of one face in one frame, and the protocol of the trackers that measure it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np

from relit_camera.base.images.image_types import Frame, Points
from relit_camera.face.head_pose import HeadPose


class FaceStatus(StrEnum):
    """Reliability of a face state."""

    FOUND = "found"
    UNCERTAIN = "uncertain"
    """There are landmarks, but the detector disagrees or confidence is low."""
    LOST = "lost"


@dataclass(frozen=True)
class FaceState:
    """One face in one frame, as measured (not smoothed).

    Attributes:
        status: found, uncertain or lost. When lost, every other field is empty.
        confidence: 0..1.
        scheme: name of the landmark scheme (see `face.landmarks.landmark_schemes`): the points' number and meaning.
        landmarks: (count, 2) float32 pixels, pixel centres at integers + ½; (0, 2) when lost.
        pose: head pose relative to the camera; None when lost.
        eyes: opening of the subject's right and left eye, lid gap over eye width (about 0.3 open, under 0.1 shut).
        mouth: inner lip gap over the distance of the outer eye corners (0 closed, 0.5 wide open).
        blendshapes: ARKit-named scores 0..1, empty where the tracker has none.
    """

    status: FaceStatus
    confidence: float = 0.0
    scheme: str = ""
    landmarks: Points = field(default_factory=lambda: np.zeros((0, 2), np.float32))
    pose: HeadPose | None = None
    eyes: tuple[float, float] = (0.0, 0.0)
    mouth: float = 0.0
    blendshapes: Mapping[str, float] = field(default_factory=dict)

    @property
    def visible(self) -> bool:
        """Whether there are landmarks and a pose."""
        return self.status is not FaceStatus.LOST and self.pose is not None


LOST = FaceState(FaceStatus.LOST)


class Tracker(Protocol):
    """Follows the largest face from frame to frame. Not thread-safe: one tracker a worker.

    A tracker keeps what it needs between frames; `reset` forgets it (after a cut, or a new source). `track` never
    raises for what a picture shows: no face is `LOST`.
    """

    name: str
    scheme: str

    def track(self, frame: Frame) -> FaceState:
        """Measure the face in `frame`."""
        ...

    def reset(self) -> None:
        """Forget the face: the next frame is searched whole."""
        ...
