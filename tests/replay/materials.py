"""What cases are played with: generated data, data beside the checkout, imported subjects, pulled models."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import numpy as np

from relit_camera.base.images.color import parse_gamma
from relit_camera.base.models.model_store import FOLDER_VARIABLE, ModelState, ModelStore
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.capture.subject_landmarks import read_landmarks
from relit_camera.face.matte_files import write_mattes
from relit_camera.subject.subject_file import SUFFIX, write_subject
from relit_studio.mannequin.__main__ import generate
from tests.gate.parts import CAPTURE
from tests.made_once import made_once

ROOT = Path(__file__).resolve().parents[2]
MODELS = ("face_mesh", "face_detector_yunet", "openseeface", "selfie_landscape", "selfie_square")
MANNEQUIN = "generated:mannequin"
SHARED = "shared:"


class UnavailableError(Exception):
    """Data that a case needs is not on this machine: no fault, the case is left out."""


def shared_folder() -> Path:
    """The folder of data beside the checkout, or where RELIT_SHARED says.

    Raises:
        UnavailableError: there is none.
    """
    folder = Path(os.environ.get("RELIT_SHARED", ROOT.parent / "shared"))
    if not (folder / "driving").is_dir():
        raise UnavailableError(f"no shared data at {folder} (set RELIT_SHARED)")
    return folder


def mannequin() -> Path:
    """The generated person: `olat/lights.lp`, `clip.mp4` and its true track, two seconds long and small."""
    makers = (*CAPTURE, "tests/replay/materials.py")
    return made_once("mannequin", lambda folder: generate(folder, size=160, lights=48, frames=48, quiet=True), makers)


def whole_picture() -> Path:
    """A matte that takes all of each picture for the person: what is relit does not depend on a network then."""
    return made_once("whole-picture.npz", lambda path: write_mattes(path, [np.ones((9, 16), np.float32)]))


@cache
def models() -> Path:
    """A folder with the public models: the user's own, else filled from the mirror in the shared data.

    Raises:
        UnavailableError: they are in neither place.
    """
    own = ModelStore()
    if all(own.state(name) is ModelState.PULLED for name in MODELS):
        return own.folder
    try:
        mirror = shared_folder() / "models"
    except UnavailableError as error:
        raise UnavailableError(f"the public models are not pulled (relit models pull), and {error}") from error
    return made_once("models", lambda folder: ModelStore(folder).pull(MODELS, mirror))


def use_models() -> None:
    """Let everything that follows in this process, and in those that it starts, find the public models.

    Raises:
        UnavailableError: they are not on this machine.
    """
    os.environ[FOLDER_VARIABLE] = str(models())


def find(place: str, folder: Path, part: str) -> Path:
    """The file that a place means.

    Args:
        place: relative to `folder`, `shared:PATH`, or `generated:mannequin`.
        folder: of the case.
        part: of the mannequin that is meant: `olat/lights.lp`, `clip.mp4`, `track.json`.

    Raises:
        UnavailableError: it is in the shared data, and they are not here.
    """
    if place == MANNEQUIN:
        return mannequin() / part
    if place.startswith(SHARED):
        return shared_folder() / place.removeprefix(SHARED)
    return folder / place


def subject_file(lights: Path, gamma: str = "srgb") -> Path:
    """The subject file of one-light pictures, as `relit capture import` makes it; a .relit file is given as it is.

    Interpolated, which is quick, is black where nothing was captured and has a white sum that is known.

    Raises:
        RelitError: the pictures cannot be imported.
    """
    if lights.suffix == SUFFIX:
        return lights
    curve = parse_gamma(gamma)
    known = read_landmarks(lights.parent / "landmarks.json", required=False)

    def make(path: Path) -> None:
        samples = import_samples(lights, curve)
        write_subject(path, build_subject(samples, "barycentric", lights.name, curve, known or None))

    return made_once(f"{lights.parent.name}-{lights.stem}-{gamma}{SUFFIX}", make)
