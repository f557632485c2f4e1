"""The files that the demonstration is shipped with. `python -m relit_studio bundle` makes them (docs/studio.md)."""

from __future__ import annotations

import logging
from functools import lru_cache
from pathlib import Path

from relit_camera.app.setup.needed_models import missing_models
from relit_camera.base.errors import StorageError
from relit_camera.base.storage.atomic_files import make_folder
from relit_camera.subject.subject import SubjectMetadata
from relit_camera.subject.subject_file import copy_subject, read_metadata

log = logging.getLogger(__name__)

FOLDER = Path(__file__).parent / "data"
SUBJECT = FOLDER / "adam.relit"
CLIP = FOLDER / "clip.mp4"
TRACK = FOLDER / "track.json"
"""What was so in each frame of the clip: it drives where no public face tracker is installed."""
MATTES = FOLDER / "mattes.npz"
"""Where the person is in each frame: used where no public matting network is installed."""
CREDITS = FOLDER / "CREDITS.md"


SUBJECT_NOTES: dict[str, object] = {"rung": "pictures", "measured_fraction": 1.0}
"""How the person was captured: rendered under one light each. The file was made before subjects noted it."""


def noted_subject(folder: Path) -> Path:
    """The subject's file with `SUBJECT_NOTES` in its header: a copy in `folder`, in place of an earlier one.

    Where none can be written it is the file itself, and the log says so.
    """
    if read_metadata(SUBJECT).rung is not None:
        return SUBJECT
    copy = folder / SUBJECT.name
    try:
        make_folder(folder)
        copy_subject(SUBJECT, copy, **SUBJECT_NOTES)
    except StorageError as error:
        log.warning("the panel does not know how the bundled person was captured: %s", error)
        return SUBJECT
    return copy


def is_demo_person(metadata: SubjectMetadata) -> bool:
    """Whether a subject with this header is the bundled person, under whatever name it is stored."""
    return metadata.model_copy(update=SUBJECT_NOTES) == _noted_header()


@lru_cache(maxsize=1)
def _noted_header() -> SubjectMetadata:
    return read_metadata(SUBJECT).model_copy(update=SUBJECT_NOTES)


def tracker_of_clip() -> str:
    """The tracker `mesh`, or the clip's own track where the public networks are not installed."""
    return f"recorded:{TRACK}" if missing_models("mesh") else "mesh"


def matte_of_clip() -> str:
    """The matte `selfie`, or the clip's own mattes where the public networks are not installed."""
    return f"recorded:{MATTES}" if missing_models("", "selfie") else "selfie"
