"""What a build keeps on disk until its subject is written, so that one that was broken off goes on from there.

Samples are half of a build's time, and all that later steps need of the film. They are kept beside the subject, where
their owner sees them and can delete them, in a folder that nobody else may enter: they are pictures of a person.
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
from relit_camera.base.models.model_store import ModelState, ModelStore
from relit_camera.base.storage import make_folder, storage_error, write_tensors
from relit_camera.base.video.video_decoding import open_stream
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.reflectance.samples import Samples

CHECKPOINT_VERSION = 1
FOLDER_SUFFIX = ".partial"
"""After the subject's name."""
SAMPLES_FILE_NAME = "samples.safetensors"

_TENSORS = ("pictures", "directions", "matte")


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What a film gave.

    Attributes:
        samples: whose shape is not known yet.
        report: `Findings.report` of what was found on the way.
    """

    samples: Samples
    report: dict[str, Any]


def input_fingerprint(video: Path, options: CaptureOptions) -> str:
    """All that samples depend on, as a text: the film's name and content, options, program, and whether it finds eyes.

    Raises:
        VideoError: there is no such film, or nothing of it can be read.
    """
    open_stream(video)[0].close()
    with video.open("rb") as file:
        content = hashlib.file_digest(file, "sha256").hexdigest()
    detector = ModelStore().state("face_detector_yunet") is ModelState.PULLED
    return json.dumps([CHECKPOINT_VERSION, __version__, video.name, content, asdict(options), detector])


class CheckpointFolder:
    """`me.relit.partial/` beside `me.relit`.

    Args:
        subject: the file that is built.
        made_of: the `input_fingerprint` of what is kept here.
        tell: told, in one line, what became of what was kept.
    """

    def __init__(self, subject: Path, made_of: str, tell: Callable[[str], None]) -> None:
        self.folder = subject.with_name(subject.name + FOLDER_SUFFIX)
        self._made_of, self._tell = made_of, tell

    def read(self) -> Checkpoint | None:
        """What was kept of the same origin. Anything else is deleted, and that is told."""
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
        """Keep what was found. Where that cannot be done it is told: the build goes on, but could not be resumed."""
        tensors = {name: np.ascontiguousarray(getattr(found.samples, name)) for name in _TENSORS}
        report = json.dumps(found.report)
        header = {"made_of": self._made_of, "report": report, "checksum": str(_checksum(tensors, report))}
        try:
            make_folder(self.folder, private=True)
            write_tensors(self.folder / SAMPLES_FILE_NAME, tensors, header)
        except StorageError as error:
            self._tell(f"warning: if broken off, this build cannot go on: {error}")

    def remove(self) -> None:
        """Delete what is kept, and what a write that was broken off has left; nothing else that lies there.

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
        """Delete it when the subject is written, or when the input is refused; keep it however else the build ends."""
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
        return Checkpoint(Samples(**tensors), json.loads(header["report"]))


def _checksum(tensors: Mapping[str, NDArray], report: str) -> int:
    """CRC-32 of all values in their order, then of the report."""
    value = 0
    for name in _TENSORS:
        value = zlib.crc32(tensors[name].data, value)
    return zlib.crc32(report.encode(), value)
