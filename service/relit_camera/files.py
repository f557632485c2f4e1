"""Writing files so that a failure leaves nothing behind."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from relit_camera.errors import StorageError


@contextmanager
def atomic_path(target: Path) -> Iterator[Path]:
    """Give a temporary path beside `target` to write to; on success it becomes `target`.

    The temporary file keeps the target's suffix (encoders choose the format by it), is fsynced and renamed.
    On any failure it is deleted and an existing target is left as it was.

    Raises:
        StorageError: the folder does not exist, is not writable, the name is too long, or the disk is full.
    """
    target = Path(target)
    try:
        if target.is_dir():
            raise StorageError(f"cannot write {target}: it is a folder", "name a file in it")
        handle, name = tempfile.mkstemp(prefix=f".{target.stem[:40]}.", suffix=target.suffix, dir=target.parent)
    except OSError as error:
        raise storage_error(target, error) from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(target)
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EACCES, errno.EROFS, errno.EFBIG):
            raise storage_error(target, error) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


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


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
