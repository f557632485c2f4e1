"""The camera's side of its keeper: finds the one that an earlier camera has left, or starts one, and talks to it."""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any

import psutil

from relit_camera.base import errors
from relit_camera.base.errors import DeviceError, KeeperLostError, RelitError
from relit_camera.devices.device_users import KEEPER_MODULE
from relit_camera.devices.keeper.keeper_process import VERSION
from relit_camera.devices.keeper.keeper_socket import MessageSocket, require_private_folder
from relit_camera.devices.keeper.kept_output import OutputOptions

log = logging.getLogger(__name__)

START_S = 20.0
"""How long a keeper may take to start, and to open what it is to hold."""
ANSWER_S = 2.0
"""How long it may take for anything else: what takes longer hangs in a driver."""
END_S = 1.0
ENDING_S = 0.2
_TRIES = 3
_NO_KEEPER = "switch the keeper off: output.keep_s: 0"
_OWN_DEVICE, _OWN_NAME = "a device of its own: output.sink", "a name of its own: output.label"


class SinkKeeper:
    """The keeper of one virtual camera, as the camera sees it. For use by one thread at a time.

    Attributes:
        hands_over: whether `leave` lets the keeper wait for the next camera in place of ending it.
        starts: how many keepers were started.
        trouble: why the camera has to do without; None where it has not.
        on_trouble: called with that when it comes.
    """

    def __init__(
        self, options: OutputOptions, keep_s: float, folder: Path, version: str = VERSION, sink: str = ""
    ) -> None:
        """Set up; nothing is started.

        Args:
            options: what the keeper is to hold.
            keep_s: how long it shows something without a camera.
            folder: for its socket; made if it is missing.
            version: of this program; a keeper of another one is replaced.
            sink: tells keepers of the same label and device apart: the same in all versions of the program, unlike the
                function that opens it, or the keeper of another version would not be found.
        """
        name = sha256("\0".join((options.label, options.device, sink, options.argument)).encode()).hexdigest()
        self._options, self._keep_s, self._version = options, keep_s, version
        self._path = folder / f"keeper-{name[:12]}"
        self._connection: MessageSocket | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._holder: psutil.Process | None = None
        """The keeper, whoever has started it; None where it cannot be seen, as in another container."""
        self.hands_over = False
        self.starts = 0
        self.trouble: DeviceError | None = None
        self.on_trouble: Callable[[DeviceError], object] = lambda error: None

    def report(self, trouble: DeviceError) -> None:
        """Note why the camera has to do without a keeper."""
        self.trouble = trouble
        self.on_trouble(trouble)

    def greet(self) -> Mapping[str, Any]:
        """Let the keeper hold the virtual camera.

        Returns:
            `layout` and `size` of its pictures, and as `info` what `KeptOutput.describe` says.

        Raises:
            KeeperLostError: there can be no keeper.
            RelitError: the virtual camera is missing, or in use.
        """
        hello = {"hello": self._version, "output": asdict(self._options), "keep_s": self._keep_s}
        for attempt in range(_TRIES):
            connection = self._connected()
            try:
                answer = self._ask(connection, hello, START_S)
            except KeeperLostError:
                continue  # it ended while we came
            if "other_version" in answer:
                self._replace()
                continue
            if "busy" in answer:
                self._drop(connection)
                self._holder = None  # another camera's
                if not answer["busy"] and attempt < _TRIES - 1:
                    time.sleep(ENDING_S)  # one that holds nothing is about to end
                    continue
                at = f" to {answer['busy']}" if answer["busy"] else ""
                own = _OWN_DEVICE if self._options.device else _OWN_NAME
                cure = f"stop that one (relit doctor names its process), or give this one {own}"
                raise DeviceError(f"another Relit Camera publishes{at} already", cure)
            return self._checked(answer)
        raise KeeperLostError("the keeper does not start", _NO_KEEPER)

    def share(self, descriptor: int) -> None:
        """Let the keeper map the memory in which pictures will lie.

        Raises:
            RelitError: it does not.
        """
        self._checked(self._ask(self._present(), {"memory": True}, ANSWER_S, descriptor))

    def show(self, slot: int, repeatable: bool) -> Mapping[str, Any]:
        """Let the keeper show the picture of a slot; returns `info` as `greet` does, where that has changed.

        Args:
            slot: of the shared memory.
            repeatable: whether it may be shown again when this camera is gone.

        Raises:
            KeeperLostError: the keeper is gone.
            RelitError: the virtual camera does not take it; it is to be greeted anew.
        """
        return self._checked(self._ask(self._present(), {"picture": slot, "repeatable": repeatable}, ANSWER_S))

    def leave(self) -> None:
        """Say goodbye: the keeper waits for the next camera with `hands_over`, or else ends. Harmless when repeated."""
        if not self.hands_over:
            self.end()
        elif self._connection is not None:
            with suppress(OSError):
                self._connection.send({"goodbye": "hand-over"})
            self._connection.close()
            self._connection = None

    def end(self) -> None:
        """End the keeper, whatever state it is in: the virtual camera is free then. Harmless when repeated."""
        connection, self._connection = self._connection, None
        is_free = False
        if connection is not None:
            connection.socket.settimeout(END_S)
            try:
                connection.send({"goodbye": "end"})
                connection.receive()
            except EOFError:
                is_free = True  # it says goodbye when it has closed the virtual camera
            except (OSError, ValueError):
                pass
            connection.close()
        if is_free:
            self._holder = None
        self._kill()
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(END_S)

    def _present(self) -> MessageSocket:
        if self._connection is None:
            raise KeeperLostError("the keeper has ended", "")
        return self._connection

    def _connected(self) -> MessageSocket:
        """The connection to the keeper, which is started if there is none.

        Raises:
            KeeperLostError: none can be started.
        """
        if self._connection is None:
            try:
                require_private_folder(self._path.parent)
            except DeviceError as error:
                raise KeeperLostError(error.what, error.cure) from error
            self._connection = self._left_behind() or self._started()
        return self._connection

    def _left_behind(self) -> MessageSocket | None:
        """The connection to the keeper that an earlier camera has left; None where there is none."""
        other = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            other.connect(str(self._path))
            found = MessageSocket(other)
            process, user = found.peer()
        except (FileNotFoundError, ConnectionRefusedError):
            other.close()
            return None
        except OSError as error:
            other.close()
            raise KeeperLostError(f"{self._path} cannot be reached: {error.strerror or error}", _NO_KEEPER) from error
        if user != os.getuid():
            other.close()
            raise KeeperLostError(f"{self._path} is another user's", "delete it")
        self._holder = _process(process)
        return found

    def _started(self) -> MessageSocket:
        own, of_keeper = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        # -P: no module of the working folder is taken for one of Python's.
        command = [sys.executable, "-P", "-m", KEEPER_MODULE, str(of_keeper.fileno()), str(self._path), self._version]
        silent = subprocess.DEVNULL
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own module
                command,
                pass_fds=[of_keeper.fileno()],
                stdin=silent,
                stdout=silent,  # whoever waits for the end of the camera's output must not wait for the keeper
                stderr=silent,
                start_new_session=True,  # what a terminal sends to the camera does not reach it
            )
        except OSError as error:
            own.close()
            raise KeeperLostError(f"no keeper can be started: {error.strerror}", "close other programs") from error
        finally:
            of_keeper.close()
        self.starts += 1
        self._holder = _process(self._process.pid)
        return MessageSocket(own)

    def _replace(self) -> None:
        """End the keeper, once another has started: so it takes over within a few milliseconds."""
        old = self._holder
        fresh = self._started()
        try:
            self._ask(fresh, {"prepare": asdict(self._options)}, START_S)
        except RelitError:
            fresh.close()  # which ends it
            self._holder = old
            raise
        log.info("the keeper is of another version, and is replaced")
        started = self._process, self._holder
        self._process, self._holder = None, old
        self.end()
        (self._process, self._holder), self._connection = started, fresh

    def _ask(
        self, connection: MessageSocket, message: Mapping[str, Any], timeout_s: float, descriptor: int | None = None
    ) -> Mapping[str, Any]:
        """The answer to a message.

        Raises:
            KeeperLostError: none comes.
        """
        connection.socket.settimeout(timeout_s)
        try:
            with suppress(BrokenPipeError, ConnectionResetError):  # it may have said why
                connection.send(message, descriptor)
            try:
                return connection.receive()[0]
            except ConnectionResetError:
                return connection.receive()[0]  # the reset is told before what was said before it
        except TimeoutError as error:
            self._kill()  # it hangs
            self._drop(connection)
            raise KeeperLostError("the virtual camera does not answer", "see what holds it: relit doctor") from error
        except ValueError as error:
            self._kill()  # else it would go on, and hold the virtual camera
            self._drop(connection)
            raise KeeperLostError("the keeper's answer cannot be read", "please report it") from error
        except (EOFError, OSError) as error:
            self._drop(connection)
            raise KeeperLostError("the keeper has ended", "it is started again by itself") from error

    def _kill(self) -> None:
        """End the keeper's process if it lives, and not another one that has its number by now."""
        holder, self._holder = self._holder, None
        if holder is not None:
            with suppress(psutil.Error):
                holder.kill()
                holder.wait(END_S)

    def _drop(self, connection: MessageSocket) -> None:
        connection.close()
        if connection is self._connection:
            self._connection = None
        if self._process is not None:
            self._process.poll()

    @property
    def path(self) -> Path:
        """Of the socket at which the keeper is found."""
        return self._path

    @property
    def connected(self) -> bool:
        """Whether one is there."""
        return self._connection is not None

    @staticmethod
    def _checked(answer: Mapping[str, Any]) -> Mapping[str, Any]:
        if "error" in answer:
            name, what, cure = (str(text) for text in answer["error"])
            kind = getattr(errors, name, None)
            raise (kind if isinstance(kind, type) and issubclass(kind, RelitError) else DeviceError)(what, cure)
        return answer


def _process(number: int) -> psutil.Process | None:
    """A process by its number, which is 0 for one of another container; None where there is none."""
    with suppress(psutil.Error):
        return psutil.Process(number) if number > 1 else None
    return None
