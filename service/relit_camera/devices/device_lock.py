"""Lets one Relit Camera at a time publish to a virtual camera.

Some versions of the driver let two programs write into each other's picture. The lock is a flock on the device node:
nothing has to be cleaned up, it ends with the process however that ends, and it holds between users. Other programs
take no notice of it.
"""

from __future__ import annotations

import os
import sys

from relit_camera.base.errors import DeviceError

if sys.platform != "win32":
    import fcntl


class DeviceLock:
    """Holds a device node until it is released. Only Linux has such nodes: elsewhere it does nothing."""

    def __init__(self, node: str) -> None:
        """Take the lock.

        Args:
            node: such as /dev/video10.

        Raises:
            DeviceError: another Relit Camera holds it, or the node cannot be opened.
        """
        self._descriptor = -1
        if not sys.platform.startswith("linux"):
            return
        try:
            self._descriptor = os.open(node, os.O_RDONLY | os.O_NONBLOCK)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.release()
            what = f"another Relit Camera publishes to {node} already"
            cure = "stop that one (relit doctor names its process), or give this one a device of its own"
            raise DeviceError(what, cure) from None
        except OSError as error:
            self.release()
            what = f"{node} cannot be opened: {error.strerror}"
            raise DeviceError(what, "see what holds it: relit doctor") from error

    def release(self) -> None:
        """Release the lock. Harmless when repeated."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)
