"""The rung desk on a known person: they sit before a simulated screen and webcam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import LightsError, SubjectError
from relit_camera.capture.desk.desk_capture import build_desk_subject
from relit_camera.capture.desk.desk_recording import DeskRecording
from relit_camera.capture.desk.person.patch_light import place_patches
from relit_camera.capture.instant.head_shape import fit_head_shape
from relit_camera.capture.lights_file import LIGHTS_FILE_NAME
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.reflectance.directional_light import directional_coefficients
from relit_camera.capture.reflectance.method_registry import ReflectanceMethod, open_method
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.desk_simulation import SCREENS, SimulatedPerson, simulate_desk_recording
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


def read_screens(folder: Path, rungs: Sequence[str]) -> dict[str, OlatSamples]:
    """The pictures before screens that `relit_studio screen` has rendered into the folder of a person's lights.

    Args:
        folder: of the lights.
        rungs: which of the screens are wanted, by name.

    Raises:
        LightsError: there are pictures of other patches than the screen's.
        ImageError: a picture cannot be read.
    """
    listed = {name: folder / name / LIGHTS_FILE_NAME for name in SCREENS if name in rungs}
    found = {name: import_samples(path) for name, path in listed.items() if path.is_file()}
    for name, samples in found.items():
        expected = place_patches(SCREENS[name]).directions
        if samples.directions.shape != expected.shape or np.abs(samples.directions - expected).max() > _APART:
            raise LightsError(
                f"{listed[name]} does not list the patches of the {name}", "render them anew, or take that folder away"
            )
    return found


_APART = 1e-3
"""Of two unit vectors, from which they are those of different patches."""


def desk_subject(person: KnownPerson, screen: str) -> Subject:
    """The subject of a simulated recording before a screen, by its name in `SCREENS`.

    Raises:
        CaptureError: the recording is not good enough.
    """
    return build_desk_subject(filmed_before(person, screen), person.name)[0]


def filmed_before(person: KnownPerson, screen: str) -> DeskRecording:
    """A simulated recording of a person before a screen of `SCREENS`, of rendered pictures where there are any."""
    rendered = person.screens.get(screen)
    return simulate_desk_recording(simulated_person(person), SCREENS[screen], patch_pictures=rendered)
