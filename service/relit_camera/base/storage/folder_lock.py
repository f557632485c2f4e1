"""Says which process a folder belongs to, so that no other one deletes there what looks like a leftover.

The lock is a flock on the folder itself: nothing has to be cleaned up, it ends with the process however that ends.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

if sys.platform != "win32":
    import fcntl


class FolderLock:
    """Holds a folder until it is released.

    Where there are no such locks, on Windows and on some network folders, every process counts as the owner.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._descriptor = -1

    def take(self) -> bool:
        """Take the folder, which must be there; returns whether this process has it now. Harmless when repeated."""
        if sys.platform == "win32":
            return True
        if self._descriptor >= 0 and self._is_same_folder():
            return True
        self.release()
        try:
            self._descriptor = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            return False
        except OSError:  # no locks here; where the folder cannot be read, whatever comes next says so
            return True
        return True

    def release(self) -> None:
        """Let another process have it. Harmless when repeated."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _is_same_folder(self) -> bool:
        """Whether the folder that is held was not deleted, or replaced by another one."""
        with suppress(OSError):
            return os.path.samestat(os.fstat(self._descriptor), self._folder.stat())
        return False
