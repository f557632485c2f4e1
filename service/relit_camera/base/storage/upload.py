"""A file that is being received, piece by piece, and may be canceled meanwhile."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from pathlib import Path

from relit_camera.base.errors import ConflictError


@dataclass(frozen=True)
class Upload:
    """Where the file is to be written, and whether it is still wanted.

    Attributes:
        path: to write to.
        canceled: is set when nobody wants the rest any more.
        what, cure: are told to the sender then.
    """

    path: Path
    canceled: threading.Event = field(default_factory=threading.Event)
    what: str = "it was canceled"
    cure: str = "send it again"

    def require_wanted(self) -> None:
        """Check that the rest is still wanted; to be called with each piece.

        Raises:
            ConflictError: it was canceled.
        """
        if self.canceled.is_set():
            raise ConflictError(self.what, self.cure)
