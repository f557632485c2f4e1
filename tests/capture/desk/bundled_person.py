"""The bundled person at a desk: what a webcam films of them follows from their subject."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relit_camera.app.demo import demo_files
from relit_camera.base.images.image_files import write_display
from relit_camera.capture.desk.desk_recording import SETUP_NAME, DeskRecording
from relit_camera.capture.instant.head_shape import fit_head_shape
from relit_camera.capture.reflectance.method_registry import open_method
from relit_camera.lab.evaluate.desk_simulation import SimulatedPerson, SimulatedWebcam, simulate_desk_recording
from relit_camera.lab.evaluate.ladder.desk_rung import SCHEME, SubjectField
from relit_camera.subject.half_size import half_size_subject
from relit_camera.subject.subject_file import read_subject


def bundled_person() -> SimulatedPerson:
    """The person, at half of their subject's size."""
    subject = half_size_subject(read_subject(demo_files.SUBJECT))
    landmarks = subject.landmarks[SCHEME]
    shape = fit_head_shape(landmarks, subject.matte)
    low, high = landmarks.min(axis=0), landmarks.max(axis=0)
    center = (low + high) / 2
    return SimulatedPerson(
        SubjectField(subject, open_method(subject.metadata.method)),
        np.asarray(np.nan_to_num(shape.geometry.depth), np.float32),
        subject.matte,
        shape.pixels_per_cm,
        (float(center[0]), float(center[1]), float(high[1] - low[1]) / 2),
    )


def film_bundled_person(folder: Path, frames_a_pattern: int, fade_frames: int) -> Path:
    """The folder with a recording of them before a monitor, in VGA, in which the face must be found."""
    webcam = SimulatedWebcam(noise=2.0, frames_a_pattern=frames_a_pattern, fade_frames=fade_frames)
    recording = simulate_desk_recording(bundled_person(), webcam=webcam)
    setup = recording.setup.model_copy(update={"face": None, "pixels_per_cm": None})
    return write_recording(folder, DeskRecording(setup, recording.frames), ".jpg")


def write_recording(folder: Path, recording: DeskRecording, suffix: str = ".png") -> Path:
    """The folder with a recording's frames and setup."""
    folder.mkdir()
    for index in range(len(recording.frames)):
        write_display(folder / f"{index:04d}{suffix}", recording.frames[index])
    (folder / SETUP_NAME).write_text(recording.setup.model_dump_json(), encoding="utf-8")
    return folder
