"""Store of finished frames, so that an interrupted capture resumes where it stopped."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from relit_camera.base.images.image_files import read_display, write_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_studio.cameras.camera_simulation import Gains


@dataclass(frozen=True, eq=False)
class FinishedFrame:
    """A finished frame.

    Attributes:
        truth: of the frame.
        next_gains: the phone's settings for the next frame.
    """

    truth: dict[str, Any]
    next_gains: Gains


class FrameStore:
    """Folder of the finished frames of one capture; frames of a capture with other settings are removed on opening."""

    def __init__(self, folder: Path, settings: Mapping[str, Any]) -> None:
        """Open `folder`, making it; `settings` say which capture this is.

        Raises:
            StorageError: it cannot be written.
        """
        self._folder = folder
        label, text = folder / "capture.json", json.dumps(settings, sort_keys=True)
        if not label.is_file() or label.read_text() != text:
            shutil.rmtree(folder, ignore_errors=True)
            make_folder(folder)
            write_atomic(label, text)

    def load(self, index: int) -> FinishedFrame | None:
        """Frame `index`, or None if it is not finished."""
        note = self._note(index)
        if not (note.is_file() and self._picture(index).is_file()):
            return None
        kept = json.loads(note.read_text())
        gains = kept["next_gains"]
        for name in ("balance", "balance_speed"):
            gains[name] = tuple(gains[name])
        return FinishedFrame(kept["truth"], Gains(**gains))

    def save(self, index: int, image: DisplayImage, done: FinishedFrame) -> None:
        """Keep frame `index`.

        Raises:
            StorageError: it cannot be written.
        """
        write_display(self._picture(index), image)
        write_atomic(self._note(index), json.dumps({"truth": done.truth, "next_gains": asdict(done.next_gains)}))

    def picture(self, index: int) -> DisplayImage:
        """The picture of a finished frame."""
        return read_display(self._picture(index))

    def remove(self) -> None:
        """Remove the frames."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _note(self, index: int) -> Path:
        return self._folder / f"{index:06d}.json"

    def _picture(self, index: int) -> Path:
        return self._folder / f"{index:06d}.png"
