"""The keeper as a process: `python -m relit_camera.devices.keeper.keeper_process DESCRIPTOR SOCKET VERSION`.

A camera starts it, connected by the descriptor. It outlives that camera, for a while, and listens at the socket for the
next one. It imports nothing but Python's own library, unless what it holds needs more.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path

from relit_camera import __version__
from relit_camera.devices.keeper.keeper import Keeper
from relit_camera.devices.keeper.keeper_socket import LockedListener, MessageSocket

PROTOCOL = 2
"""Another number where cameras and keepers say other things to each other than before."""
VERSION = f"{__version__} {PROTOCOL}"
"""A camera of another version starts a keeper of its own in place of this one, where that ends nobody's call."""


class KeeperProcess:
    """Serves one camera at a time, and tells any other that it is busy."""

    def __init__(self, first: MessageSocket, path: Path, keeper: Keeper) -> None:
        """Set up.

        Args:
            first: the camera that has started this process.
            path: of the socket at which the next one finds it.
            keeper: does the work.
        """
        self._camera: MessageSocket | None = first
        self._path, self._keeper = path, keeper
        self._listening: LockedListener | None = None
        keeper.has_camera = True

    def run(self) -> None:
        """Go on until nothing is left to be kept."""
        try:
            while (wait_s := self._keeper.step()) is not None:
                camera, listening = self._camera, self._listening
                sockets = [*([camera.socket] if camera else []), *([listening.listener] if listening else [])]
                ready, _, _ = select.select(sockets, [], [], wait_s)
                # Whether the camera has left is heard before the next one is answered.
                if camera is not None and camera.socket in ready and not self._serve(camera):
                    self._keeper.camera_left()
                    if self._keeper.place:  # else this ends, and the camera hears of it last
                        camera.close()
                        self._camera = None
                if listening is not None and listening.listener in ready:
                    self._accept(listening)
        finally:
            # In this order: whoever may listen finds the virtual camera free.
            self._keeper.close()
            if self._listening is not None:
                self._listening.release()
            if self._camera is not None:
                self._camera.close()

    def _accept(self, listening: LockedListener) -> None:
        other = MessageSocket(listening.listener.accept()[0])
        if other.peer()[1] != os.getuid():
            other.close()
        elif self._camera is None:
            self._camera = other
            self._keeper.has_camera = True
        else:
            with suppress(OSError):
                other.send({"busy": self._keeper.place})
            other.close()

    def _serve(self, camera: MessageSocket) -> bool:
        """Answer one message. Returns whether the camera stays."""
        try:
            message, memory = camera.receive()
            if self._listening is None and "hello" in message:
                try:
                    self._listening = LockedListener(self._path)
                except BlockingIOError:
                    camera.send({"busy": ""})
                    return False
            answer = self._keeper.handle(message, memory)
            if answer is not None:
                camera.send(answer)
        except (EOFError, OSError, ValueError, KeyError, TypeError):  # gone, or no camera of ours
            return False
        return answer is not None


def main() -> None:
    """Run the process."""
    # What ends the camera from a terminal must not end its keeper. It is told by the camera.
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    os.chdir("/")
    first = MessageSocket(socket.socket(fileno=int(sys.argv[1])))
    KeeperProcess(first, Path(sys.argv[2]), Keeper(sys.argv[3])).run()


if __name__ == "__main__":
    main()
