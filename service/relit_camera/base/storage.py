"""Writing files so that a failure leaves nothing behind, and a crash nothing that stays.

Arrays in a safetensors file, written whole or not at all.
"""

from __future__ import annotations

import errno
import os
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from relit_camera.base.errors import StorageError

if sys.platform != "win32":
    import fcntl

NEW_FILE_GRACE_S = 60.0
"""An unfinished file without content may have been made just now, by a writer who is about to lock it."""
STALE_FILE_AGE_S = 86400.0
"""Where files cannot be locked, an unfinished one is left over when nobody has written to it for so long."""

_UNFINISHED_MARK = ".unfinished-"
_UNFINISHED_PATTERN = re.compile(rf"^\..{{1,40}}{re.escape(_UNFINISHED_MARK)}[a-z0-9_]{{8}}(\.\w+)?$")


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Give a temporary path beside `target` to write to; on success it becomes `target`.

    The temporary file keeps the target's suffix (encoders choose the format by it), is fsynced and renamed, and the
    folder is fsynced: whenever the program or the machine stops, `target` is the old file or the new one, whole.
    On any failure the temporary file is deleted and an existing target is left as it was. Where the program is killed,
    it stays, and `remove_unfinished_files` finds it: a lock, which ends with the process, tells it from one in the
    making.

    Raises:
        StorageError: the folder does not exist, is not writable, the name is too long, or the disk is full.
    """
    target = Path(target)
    try:
        if target.is_dir():
            raise StorageError(f"cannot write {target}: it is a folder", "name a file in it")
        handle, name = tempfile.mkstemp(
            prefix=f".{target.stem[:40]}{_UNFINISHED_MARK}", suffix=target.suffix, dir=target.parent
        )
    except OSError as error:
        raise storage_error(target, error) from error
    temporary = Path(name)
    try:
        with _locked(handle):
            yield temporary
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
            temporary.chmod(0o666 & ~_umask())
            temporary.replace(target)
        _sync_folder(target.parent)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EROFS, errno.EFBIG):
            raise storage_error(target, error) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def remove_unfinished_files(folder: Path) -> list[Path]:
    """Delete what killed programs have left of `atomic_path` in a folder; returns what was deleted.

    Files that are being written, by whatever process of this machine, are left alone, and so are all others. A folder
    that is not there or may not be written to is no error.
    """
    swept = []
    with suppress(OSError):
        for path in [path for path in folder.iterdir() if _UNFINISHED_PATTERN.match(path.name)]:
            with suppress(OSError):
                if _is_abandoned(path):
                    path.unlink()
                    swept.append(path)
    return swept


def write_atomic(target: Path, data: bytes | str) -> None:
    """Write `data` (text as UTF-8) to `target` whole or not at all.

    Raises:
        StorageError: as `atomic_path`.
    """
    with atomic_path(target) as temporary:
        temporary.write_bytes(data.encode() if isinstance(data, str) else data)


def make_folder(folder: Path, private: bool = False) -> None:
    """Create a folder and those above it, where they are missing; a private one only its owner may enter.

    Raises:
        StorageError: it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700 if private else 0o777)
        if private:  # also if it was there
            folder.chmod(0o700)
    except OSError as error:
        raise storage_error(folder, error) from error


def storage_error(target: Path, error: OSError) -> StorageError:
    """What a person is told when `target` cannot be written: why, and the cure."""
    cures = {
        errno.ENOENT: "create the folder first",
        errno.ENAMETOOLONG: "choose a shorter name",
        errno.EACCES: "choose a folder you may write to",
        errno.EROFS: "choose a folder you may write to",
        errno.ENOSPC: "free some space on the disk",
        errno.EDQUOT: "free some space within your quota",
    }
    reason = os.strerror(error.errno) if error.errno else str(error)
    return StorageError(f"cannot write {target}: {reason}", cures.get(error.errno or 0, "choose another place"))


@contextmanager
def _locked(handle: int) -> Iterator[None]:
    """Hold an open file for oneself, and close it. Windows can rename no open file: there it is closed at once."""
    if sys.platform == "win32":
        os.close(handle)
        yield
        return
    try:
        with suppress(OSError):  # a file system without locks: `remove_unfinished_files` cannot lock there either
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def _is_abandoned(path: Path) -> bool:
    status = path.lstat()
    age_s = time.time() - status.st_mtime
    if sys.platform == "win32":
        return age_s > STALE_FILE_AGE_S
    if status.st_size == 0 and age_s < NEW_FILE_GRACE_S:
        return False
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return age_s > STALE_FILE_AGE_S
    finally:
        os.close(handle)
    return True


def _sync_folder(folder: Path) -> None:
    """Make a rename in the folder survive a power cut, where the system can: not every one lets a folder be fsynced."""
    if sys.platform == "win32":
        return
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_tensors(path: Path, tensors: Mapping[str, NDArray], header: Mapping[str, str]) -> None:
    """Write arrays of any shape and type, and texts beside them.

    Raises:
        StorageError: the file cannot be written.
    """
    contiguous = {name: np.ascontiguousarray(value) for name, value in tensors.items()}
    # In memory: `save_file` would write beside the target, to a file of its own that a crash leaves behind.
    write_atomic(path, save(contiguous, metadata=dict(header)))
