"""One Relit Camera a device: the driver itself lets two of them write into each other's picture, in some versions.

The claim is a lock (flock) on the device node: nothing to clean up, it ends with the process however that ends, and it
holds between users. Programs that are not ours take no notice of it.
"""

from __future__ import annotations

import os
import sys

from relit_camera.errors import DeviceError


class Claim:
    """Holds a device node until it is released."""

    def __init__(self, node: str) -> None:
        """Take the claim.

        Args:
            node: such as /dev/video10.

        Raises:
            DeviceError: another Relit Camera has it, or the node cannot be opened.
        """
        self._descriptor = -1
        if not sys.platform.startswith("linux"):
            return
        import fcntl

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
        """Let go. Harmless when repeated."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)
