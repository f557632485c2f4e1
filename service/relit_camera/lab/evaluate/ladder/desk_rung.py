"""The rung desk on a known person: they sit before a simulated screen and webcam."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import SubjectError
from relit_camera.capture.desk.desk_capture import build_desk_subject
from relit_camera.capture.desk.desk_recording import DeskSetup
from relit_camera.capture.instant.head_shape import fit_head_shape
from relit_camera.capture.reflectance.directional_light import directional_coefficients
from relit_camera.capture.reflectance.method_registry import ReflectanceMethod, open_method
from relit_camera.lab.evaluate.desk_simulation import SimulatedPerson, simulate_desk_recording
from relit_camera.lab.evaluate.ladder.known_person import KnownPerson
from relit_camera.subject.subject import Subject

SCHEME = "mesh478"


@dataclass(frozen=True)
class SubjectField:
    """A subject's field, for any direction.

    Attributes:
        subject: whose light map is interpolated between texels.
        method: that built it.
    """

    subject: Subject
    method: ReflectanceMethod

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.subject.metadata.height, self.subject.metadata.width

    def dense(self, start: int, stop: int) -> NDArray[np.float32]:
        """R of the pixels [start, stop) in row-major order: (stop − start, 2048, 3)."""
        return self.subject.basis.at(self.subject.coefficients, np.arange(start, stop)).transpose(1, 0, 2)

    def at(self, directions: NDArray[np.float64], pixels: NDArray[np.intp]) -> NDArray[np.float32]:
        """R of row-major pixels (some,) under unit vectors (count, 3): (count, some, 3)."""
        return self.subject.basis.at(directional_coefficients(self.subject, self.method, directions), pixels)


def simulated_person(person: KnownPerson) -> SimulatedPerson:
    """The known person as the simulation of desk recordings wants them; the shape is estimated from their pictures.

    Raises:
        CaptureError: the landmarks of their face are no head's.
        SubjectError: their face has no landmarks.
    """
    landmarks = person.subject.landmarks.get(SCHEME)
    if landmarks is None:
        raise SubjectError(
            f"no face is found in the pictures of {person.name}", "give a person who looks to the camera"
        )
    low, high = landmarks.min(axis=0), landmarks.max(axis=0)
    center = (low + high) / 2
    return SimulatedPerson(
        field=SubjectField(person.subject, open_method(person.subject.metadata.method)),
        depth_px=person.samples.geometry.depth,
        matte=person.samples.matte,
        pixels_per_cm=fit_head_shape(landmarks, person.samples.matte).pixels_per_cm,
        face=(float(center[0]), float(center[1]), float(high[1] - low[1]) / 2),
    )


def desk_subject(person: KnownPerson, setup: DeskSetup) -> Subject:
    """The subject of a simulated recording before that screen.

    Raises:
        CaptureError: the recording is not good enough.
    """
    recording = simulate_desk_recording(simulated_person(person), setup)
    return build_desk_subject(recording, person.name)[0]
