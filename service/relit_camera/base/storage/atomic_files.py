"""Writing files whole or not at all: to a temporary file beside the target, which is renamed when it is complete.

What a crash leaves of temporary files is deleted at the next start. Arrays are written as safetensors files.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import sys
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
"""An empty temporary file younger than this is left alone: its writer may be about to lock it."""
STALE_FILE_AGE_S = 86400.0
"""Where the file system has no locks, a temporary file is abandoned when it was not written to for this long."""

_CREATE_NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_UNFINISHED_MARK = ".unfinished-"
_UNFINISHED_PATTERN = re.compile(rf"^\..{{1,40}}{re.escape(_UNFINISHED_MARK)}[a-z0-9_]{{8}}(\.\w+)?$")


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Give a temporary path beside `target` to write to; on success it becomes `target`.

    The temporary file keeps the target's suffix (encoders choose the format by it), is fsynced and renamed, and the
    folder is fsynced: whenever the program or the machine stops, `target` is the old file or the new one, whole.
    On any failure the temporary file is deleted and an existing target is left as it was. A killed program leaves it
    behind, for `remove_unfinished_files` to delete: a lock, which ends with the process, marks one still being written.

    Raises:
        StorageError: the folder does not exist, is not writable, the name is too long, or the disk is full.
    """
    target = Path(target)
    try:
        if target.is_dir():
            raise StorageError(f"cannot write {target}: it is a folder", "name a file in it")
        temporary = target.with_name(f"{_unfinished_start(target)}{secrets.token_hex(4)}{target.suffix}")
        # Created with the mode it shall have in the end (not by `tempfile`, which creates private files): the kernel
        # applies the umask and the folder's access list, and nothing has to read or set the umask of all threads.
        handle = os.open(temporary, _CREATE_NEW, 0o666)
    except OSError as error:
        raise storage_error(target, error) from error
    try:
        with _locked(handle):
            yield temporary
            with temporary.open("rb") as written:
                os.fsync(written.fileno())
            temporary.replace(target)
        _sync_folder(target.parent)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EROFS, errno.EFBIG):
            raise storage_error(target, error) from error
        raise
    finally:
        with suppress(OSError):  # a disk that has become read-only: `remove_unfinished_files` deletes it later
            temporary.unlink(missing_ok=True)


def remove_unfinished_files(folder: Path, target: Path | None = None) -> list[Path]:
    """Delete the temporary files of `atomic_path` that killed programs left in a folder; returns those deleted.

    With `target` only those that were to become that file. Files that any process of this machine is still writing are
    left alone, and so are all other files. A folder that does not exist or may not be written to is no error.
    """
    removed = []
    with suppress(OSError):
        start = "" if target is None else _unfinished_start(target)
        found = [path for path in folder.iterdir() if _UNFINISHED_PATTERN.match(path.name)]
        for path in [path for path in found if path.name.startswith(start)]:
            with suppress(OSError):
                if _is_abandoned(path):
                    path.unlink()
                    removed.append(path)
    return removed


def write_atomic(target: Path, data: bytes | str) -> None:
    """Write `data` (text as UTF-8) to `target` whole or not at all.

    Raises:
        StorageError: as `atomic_path`.
    """
    with atomic_path(target) as temporary:
        temporary.write_bytes(data.encode() if isinstance(data, str) else data)


def make_folder(folder: Path, private: bool = False) -> None:
    """Create a folder and its parents where they are missing; with `private` only its owner may enter it.

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
    """The error for a file that cannot be written: the reason, and a cure that suits it."""
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
    """Lock an open file within the block, and close it. On Windows, which renames no open file, it is closed first."""
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


def _unfinished_start(target: Path) -> str:
    """What the names of the temporary files begin with that become `target`."""
    return f".{target.stem[:40]}{_UNFINISHED_MARK}"


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


def write_tensors(path: Path, tensors: Mapping[str, NDArray], header: Mapping[str, str]) -> None:
    """Write a safetensors file: arrays of any shape and type by name, and texts by name as its header.

    Raises:
        StorageError: the file cannot be written.
    """
    contiguous = {name: np.ascontiguousarray(value) for name, value in tensors.items()}
    # Serialized in memory: `save_file` would write a temporary file of its own, which a crash leaves behind.
    write_atomic(path, save(contiguous, metadata=dict(header)))
