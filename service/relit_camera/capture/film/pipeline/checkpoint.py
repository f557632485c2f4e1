"""Checkpoint of a build: samples kept on disk until the subject is written, so that an interrupted build can resume.

Samples take half of a build's time and are all that later steps need of the film. They are pictures of a person, so
they lie in a folder that only its owner may enter, beside the subject, where the owner sees it and can delete it.
"""

from __future__ import annotations

import hashlib
import json
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open

from relit_camera import __version__
from relit_camera.base.errors import InputError, StorageError
from relit_camera.base.models.model_store import installed_model
from relit_camera.base.storage.atomic_files import make_folder, storage_error, write_tensors
from relit_camera.base.video.video_decoding import open_stream
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.face.detection.installed_detector import DETECTORS

CHECKPOINT_VERSION = 1
FOLDER_SUFFIX = ".partial"
"""The folder's name is the subject's with this suffix."""
SAMPLES_FILE_NAME = "samples.safetensors"

_TENSORS = ("pictures", "directions", "matte")


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What a film gave.

    Attributes:
        samples: aligned pictures under one distant light each.
        report: of the capture, `Findings.report`.
    """

    samples: OlatSamples
    report: dict[str, Any]


def input_fingerprint(video: Path, options: CaptureOptions) -> str:
    """Text of all that samples depend on: film name and content, options, version, and the detector that is installed.

    Raises:
        VideoError: there is no such film, or nothing of it can be read.
    """
    open_stream(video)[0].close()
    with video.open("rb") as file:
        content = hashlib.file_digest(file, "sha256").hexdigest()
    detector = installed_model(DETECTORS)
    return json.dumps([CHECKPOINT_VERSION, __version__, video.name, content, asdict(options), detector])


class CheckpointFolder:
    """The folder of a build's checkpoint: `me.relit.partial/` beside `me.relit`.

    Args:
        subject: the file that is built.
        made_of: `input_fingerprint` of the build.
        tell: called with one line for the user about what happens to the checkpoint.
    """

    def __init__(self, subject: Path, made_of: str, tell: Callable[[str], None]) -> None:
        self.folder = subject.with_name(subject.name + FOLDER_SUFFIX)
        self._made_of, self._tell = made_of, tell

    def read(self) -> Checkpoint | None:
        """The checkpoint of the same input, if there is one. Any other is deleted, and the user is told."""
        try:
            found = self._read()
            why = "is of another film, other options or another version"
        except FileNotFoundError:
            return None
        except (SafetensorError, OSError, KeyError, ValueError):
            found, why = None, "is damaged"
        if found is None:
            self._tell(f"what lies in {self.folder} {why}: starting over")
            self.remove()
        else:
            self._tell(f"going on from {self.folder}, where the last build was broken off")
        return found

    def write(self, found: Checkpoint) -> None:
        """Write the checkpoint. If that fails, the user is told and the build goes on, but it could not be resumed."""
        tensors = {name: np.ascontiguousarray(getattr(found.samples, name)) for name in _TENSORS}
        report = json.dumps(found.report)
        header = {"made_of": self._made_of, "report": report, "checksum": str(_checksum(tensors, report))}
        try:
            make_folder(self.folder, private=True)
            write_tensors(self.folder / SAMPLES_FILE_NAME, tensors, header)
        except StorageError as error:
            self._tell(f"warning: if broken off, this build cannot go on: {error}")

    def remove(self) -> None:
        """Delete the checkpoint and what an interrupted write has left, but no other files of the folder.

        Raises:
            StorageError: it cannot be deleted.
        """
        try:
            for file in self.folder.glob(f"*{Path(SAMPLES_FILE_NAME).suffix}"):
                file.unlink()
        except OSError as error:
            raise storage_error(self.folder, error) from error
        with suppress(OSError):
            self.folder.rmdir()

    @contextmanager
    def keep_until_done(self) -> Iterator[None]:
        """Context of a build: delete the checkpoint if the build succeeds or its input is refused, else keep it."""
        try:
            yield
        except InputError:
            self.remove()
            raise
        except (KeyboardInterrupt, SystemExit):
            if (self.folder / SAMPLES_FILE_NAME).exists():
                self._tell(f"kept in {self.folder}: the same command goes on from there, --fresh starts over")
            raise
        self.remove()

    def _read(self) -> Checkpoint | None:
        with safe_open(self.folder / SAMPLES_FILE_NAME, framework="numpy") as file:
            header = file.metadata() or {}
            if header["made_of"] != self._made_of:
                return None
            tensors = {name: file.get_tensor(name) for name in _TENSORS}
        if int(header["checksum"]) != _checksum(tensors, header["report"]):
            raise ValueError("the checksum is another")
        return Checkpoint(OlatSamples(**tensors), json.loads(header["report"]))


def _checksum(tensors: Mapping[str, NDArray], report: str) -> int:
    """CRC-32 of the tensors' bytes in order, then of the report."""
    value = 0
    for name in _TENSORS:
        value = zlib.crc32(tensors[name].data, value)
    return zlib.crc32(report.encode(), value)
