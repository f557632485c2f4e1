"""The keeper's work, without sockets: it answers the camera's messages, and shows something while none come."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock
from relit_camera.base.errors import RelitError
from relit_camera.devices.keeper.keeper_state import (
    LAST_PICTURE_S,
    KeeperLimits,
    KeeperState,
    KeeperStep,
    next_step,
)
from relit_camera.devices.keeper.kept_output import (
    KeptOutput,
    OutputOptions,
    open_kept_output,
    picture_bytes,
    prepare_output,
)

PICTURE_SLOTS = 2
"""Pictures in the shared memory: while the camera writes one, the keeper may repeat the other. The placeholder follows
them."""
IDLE_S = 60.0
"""How long to wait while a camera is there and nothing is held."""

Message = Mapping[str, Any]


class Keeper:
    """Holds a virtual camera for one camera after the other. For use by one thread.

    Attributes:
        has_camera: whether one is there.
    """

    def __init__(
        self,
        version: str,
        open_output: Callable[[OutputOptions], KeptOutput] = open_kept_output,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up; nothing is held yet.

        Args:
            version: of the program, and the number of what is said to it. A camera of another version is told so, that
                it may replace this keeper; where the number is the same, only if that ends nobody's call.
            open_output: opens what a camera names.
            clock: to measure by.
        """
        self.has_camera = False
        self._version, self._open, self._clock = version, open_output, clock
        self._options: OutputOptions | None = None
        self._output: KeptOutput | None = None
        self._limits = KeeperLimits(1.0, 0.0)
        self._memory = self._placeholder = self._last = memoryview(b"")
        self._last_slot = -1
        """Where the last picture lies in the memory; -1 where it is not of this memory."""
        self._told: dict[str, Any] = {}
        self._state: KeeperState | None = None

    @property
    def place(self) -> str:
        """Where what is held shows pictures, in words; empty while nothing is held."""
        return "" if self._output is None else self._output.place or "a virtual camera"

    def handle(self, message: Message, memory: memoryview | None = None) -> Message | None:
        """Do what the camera asks for, and return the answer; None for none.

        Args:
            message: `prepare`, `hello`, `memory`, `picture` or `goodbye`, each with what belongs to it.
            memory: shared with the camera; goes with `memory`.
        """
        self.has_camera = True
        try:
            if "prepare" in message:
                prepare_output(_options(message["prepare"]))
                return {}
            if "hello" in message:
                return self._greet(message)
            if "memory" in message and memory is not None:
                return self._use(memory)
            if "picture" in message:
                return self._show(int(message["picture"]), bool(message["repeatable"]))
            if message.get("goodbye") == "end":
                self.close()
            self.camera_left()
            return None
        except RelitError as error:
            self.close()
            return {"error": [type(error).__name__, error.what, error.cure]}

    def camera_left(self) -> None:
        """The camera is gone, by a goodbye or without one."""
        self.has_camera = False
        if self._state is not None:
            self._state = replace(self._state, connected=False)
            if not self._state.repeatable:
                self._last = memoryview(b"")

    def step(self) -> float | None:
        """Do what is due; returns the seconds after which to call again if no message comes, None at the end."""
        if self._output is None or self._state is None:
            return IDLE_S if self.has_camera else None
        now = self._clock.now()
        step, wait_s = next_step(self._state, now, self._limits)
        if step is KeeperStep.END:
            self.close()
            return None
        if step is not KeeperStep.WAIT:
            picture = self._last if step is KeeperStep.REPEAT and len(self._last) else self._placeholder
            try:
                self._output.send(picture)
            except RelitError:
                self.close()  # a camera that is there hears of it with its next picture
                return self.step()
            self._state = replace(self._state, shown_at=self._clock.now())
        return wait_s

    def close(self) -> None:
        """Close what is held. Harmless when repeated."""
        output, self._output, self._options, self._state = self._output, None, None, None
        self._memory = self._placeholder = self._last = memoryview(b"")  # nobody's pictures are kept
        if output is not None:
            with suppress(RelitError, OSError):
                output.close()

    def _greet(self, message: Message) -> Message:
        is_bound = self._output is not None and self._output.is_bound
        version = str(message["hello"])
        if version != self._version and not (is_bound and _protocol(version) == _protocol(self._version)):
            self.has_camera = False
            return {"other_version": self._version}
        options = _options(message["output"])
        if self._output is None or (options != self._options and not is_bound):
            self.close()
            self._output, self._options = self._open(options), options
        self._limits = KeeperLimits(1 / options.fps, float(message["keep_s"]))
        if self._state is not None:
            # The last picture is another camera's, which cannot take it back any more.
            self._state = replace(self._state, connected=True)
        self._told = self._output.describe()
        return {"info": self._told, "layout": self._output.layout, "size": self._output.size}

    def _use(self, memory: memoryview) -> Message:
        """Take the memory in which the camera's pictures will lie. The last picture of the one before stays."""
        if self._output is None or len(memory) < (PICTURE_SLOTS + 1) * picture_bytes(
            self._output.size, self._output.layout
        ):
            return {"error": ["DeviceError", "the keeper holds nothing of that size", ""]}
        self._memory, self._placeholder = memory, self._slot(memory, PICTURE_SLOTS)
        self._last_slot = -1
        if self._state is None:  # the placeholder, until the first picture comes
            now = self._clock.now()
            self._state = KeeperState(now - LAST_PICTURE_S, now - self._limits.repeat_s, True, False)
        return {}

    def _show(self, slot: int, repeatable: bool) -> Message:
        if self._output is None or not len(self._memory):
            return {"error": ["DeviceError", "the keeper holds no virtual camera", ""]}
        # A camera writes no new picture where the last one lies, so that is the same again.
        picture = self._last if slot == self._last_slot else self._slot(self._memory, slot)
        self._output.send(picture)
        now = self._clock.now()
        self._last, self._last_slot = picture, slot
        self._state = KeeperState(now, now, connected=True, repeatable=repeatable)
        info = self._output.describe()
        if info == self._told:
            return {}
        self._told = info
        return {"info": info}

    def _slot(self, memory: memoryview, slot: int) -> memoryview:
        assert self._output is not None
        count = picture_bytes(self._output.size, self._output.layout)
        return memory[slot * count : (slot + 1) * count]


def _protocol(version: str) -> str:
    """What is said, of a version such as `1.2.0 3`."""
    return version.rpartition(" ")[2]


def _options(values: Mapping[str, Any]) -> OutputOptions:
    return OutputOptions(**{**values, "size": tuple(values["size"])})
