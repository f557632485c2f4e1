"""How a camera and its keeper talk: whole messages of JSON over a Unix socket, and memory that both have mapped.

The socket lies in a folder that only its user may enter, and whoever connects must be the same user.
"""

from __future__ import annotations

import json
import mmap
import os
import socket
import stat
import struct
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from relit_camera.base.errors import DeviceError

if sys.platform != "win32":  # nor are there keepers
    import fcntl

MAX_MESSAGE_BYTES = 1 << 16
_CREDENTIALS = struct.Struct("3i")
"""ucred of socket(7): process, user, group."""


class MessageSocket:
    """One end of a connection. `receive` and `send` may wait for as long as `settimeout` of `socket` says."""

    def __init__(self, connected: socket.socket) -> None:
        """Take a connected socket of type SOCK_SEQPACKET."""
        self.socket = connected

    def send(self, message: Mapping[str, Any], descriptor: int | None = None) -> None:
        """Send a message, and with it an open file.

        Raises:
            OSError: the other end is gone, or does not take it in time.
        """
        files = [] if descriptor is None else [descriptor]
        socket.send_fds(self.socket, [json.dumps(message).encode()], files)

    def receive(self) -> tuple[Mapping[str, Any], memoryview | None]:
        """The next message, and the memory of the file that came with it.

        Raises:
            EOFError: the other end is gone.
            OSError: nothing comes in time.
            ValueError: it is no message.
        """
        data, files, _, _ = socket.recv_fds(self.socket, MAX_MESSAGE_BYTES, 1)
        try:
            if not data:
                raise EOFError("the other end is gone")
            message = json.loads(data)
            if not isinstance(message, dict):
                raise ValueError("a message is an object")
            return message, mapped(files[0]) if files else None
        finally:
            for file in files:
                os.close(file)

    def peer(self) -> tuple[int, int]:
        """Process and user of the other end, as the kernel says."""
        found = self.socket.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
        process, user, _ = _CREDENTIALS.unpack(found)
        return process, user

    def close(self) -> None:
        """Close it. Harmless when repeated."""
        self.socket.close()


def mapped(descriptor: int) -> memoryview:
    """The memory of a file, shared with whoever else maps it.

    Raises:
        ValueError: it could be cut short, which would end whoever reads it.
    """
    if not fcntl.fcntl(descriptor, fcntl.F_GET_SEALS) & fcntl.F_SEAL_SHRINK:
        raise ValueError("shared memory must be sealed")
    return memoryview(mmap.mmap(descriptor, os.fstat(descriptor).st_size))


def shared_memory(size: int) -> int:
    """A file of memory without a name, of so many bytes for ever; returns its descriptor."""
    descriptor = os.memfd_create("relit-camera-pictures", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    os.ftruncate(descriptor, size)
    fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW)
    return descriptor


def require_private_folder(folder: Path) -> None:
    """Make a folder for sockets, or check that nobody but this user may enter the one that is there.

    Raises:
        DeviceError: it cannot be made, or is somebody else's.
    """
    cure = "set XDG_RUNTIME_DIR to a folder of your own, or switch the keeper off (output.keep_s: 0)"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.lstat()
    except OSError as error:
        raise DeviceError(f"{folder} cannot be made: {error.strerror}", cure) from error
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o077:
        raise DeviceError(f"{folder} is not a folder that you alone may enter", cure)


class LockedListener:
    """The right to listen at a path, which one process has at a time. It ends with the process, however that ends.

    Attributes:
        listener: takes connections.
    """

    def __init__(self, path: Path) -> None:
        """Lock the path, and listen.

        Raises:
            BlockingIOError: another process has it.
            OSError: there can be no socket there.
        """
        self._path = path
        self._lock = os.open(f"{path}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with suppress(FileNotFoundError):
                path.unlink()  # of one that was killed
            self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            mask = os.umask(0o177)
            try:
                self.listener.bind(str(path))
            finally:
                os.umask(mask)
            self.listener.listen()
        except OSError:
            os.close(self._lock)
            raise

    def release(self) -> None:
        """Let another process have it."""
        with suppress(OSError):
            self._path.unlink()
        self.listener.close()
        os.close(self._lock)
