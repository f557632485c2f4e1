"""The controls of a webcam that change its pictures by themselves: held for a capture, and put back whatever happens.

V4L2 lets a second program set the controls of a camera that another one streams from, so they are set on a descriptor
of their own.
"""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from relit_camera.base.errors import DeviceError
from relit_camera.devices.v4l2 import ControlRange, get_control, query_control, set_control

log = logging.getLogger(__name__)

# linux/v4l2-controls.h
CONTRAST_COMPENSATION = 0x0098091C
AUTO_WHITE_BALANCE = 0x0098090C
WHITE_BALANCE_TEMPERATURE = 0x0098091A
AUTO_GAIN = 0x00980912
GAIN = 0x00980913
EXPOSURE_MODE = 0x009A0901
EXPOSURE_TIME = 0x009A0902
EXPOSURE_CHANGES_RATE = 0x009A0903
AUTO_FOCUS = 0x009A090C

EXPOSURE_MANUAL = 1
"""Value of `EXPOSURE_MODE`: V4L2_EXPOSURE_MANUAL."""
EXPOSURE_UNIT_S = 1e-4
"""Unit of `EXPOSURE_TIME`."""

AUTOMATIC = {
    EXPOSURE_MODE: EXPOSURE_MANUAL,
    EXPOSURE_CHANGES_RATE: 0,
    AUTO_GAIN: 0,
    AUTO_WHITE_BALANCE: 0,
    AUTO_FOCUS: 0,
    CONTRAST_COMPENSATION: 0,
}
"""Controls that let the webcam change its pictures, and the value that stops it. Values of others are kept as they are:
what the webcam has chosen by itself until then."""
VALUES = (EXPOSURE_TIME, GAIN, WHITE_BALANCE_TEMPERATURE)
"""Controls whose present value is what the webcam has chosen."""


class ControlDevice(Protocol):
    """Access to the controls of one device. The calls raise OSError as the kernel answers."""

    def query(self, control: int) -> ControlRange | None:
        """The range of a control; None where there is none that can be set."""
        ...

    def get(self, control: int) -> int:
        """The present value."""
        ...

    def set(self, control: int, value: int) -> None:
        """Set a value."""
        ...


@dataclass(frozen=True)
class V4l2Controls:
    """The controls of an open V4L2 node.

    Attributes:
        descriptor: of the node.
    """

    descriptor: int

    def query(self, control: int) -> ControlRange | None:
        """The range of a control; None where there is none that can be set."""
        return query_control(self.descriptor, control)

    def get(self, control: int) -> int:
        """The present value."""
        return get_control(self.descriptor, control)

    def set(self, control: int, value: int) -> None:
        """Set a value."""
        set_control(self.descriptor, control, value)


@dataclass
class HeldControls:
    """The controls of a webcam that are held.

    Attributes:
        device: the webcam's.
        ranges: of the controls that it has.
        found: the value that each had before.
    """

    device: ControlDevice
    ranges: dict[int, ControlRange]
    found: dict[int, int] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """What is held, as the driver calls it."""
        return [self.ranges[control].name for control in self.found]

    @property
    def can_expose(self) -> bool:
        """Whether exposure time can be set."""
        return EXPOSURE_TIME in self.found

    def set(self, control: int, value: int) -> bool:
        """Set a held control to the nearest allowed value. Returns whether the webcam took it."""
        allowed = self.ranges.get(control)
        if allowed is None or control not in self.found:
            return False
        steps = round((min(max(value, allowed.least), allowed.most) - allowed.least) / allowed.step)
        try:
            self.device.set(control, allowed.least + steps * allowed.step)
        except OSError as error:
            log.info("the webcam does not take %s: %s", allowed.name, error)
            return False
        return True

    def read(self) -> None:
        """Note the present values of all controls that the webcam has."""
        for control in (*AUTOMATIC, *VALUES):
            allowed = self.device.query(control)
            if allowed is None:
                continue
            try:
                self.found[control] = self.device.get(control)
            except OSError as error:
                log.info("the webcam does not tell %s: %s", allowed.name, error)
                continue
            self.ranges[control] = allowed

    def hold(self) -> None:
        """Stop what is automatic, at the values that it had chosen."""
        for control, value in AUTOMATIC.items():
            self.set(control, value)
        # Set again: some webcams jump to a default as soon as the automatic is off.
        for control in VALUES:
            self.set(control, self.found.get(control, 0))

    def restore(self) -> None:
        """Put all values back; what is automatic comes last, since the webcam takes no values then."""
        for control in (*VALUES, *AUTOMATIC):
            if control in self.found:
                with suppress(OSError):  # a value that the automatic owns, or a webcam that was unplugged
                    self.device.set(control, self.found[control])


@contextmanager
def hold_controls(
    device: ControlDevice, keep: Callable[[Mapping[int, int]], None] = lambda values: None
) -> Iterator[HeldControls]:
    """Hold what a webcam changes by itself for the length of a block.

    Args:
        device: the webcam's controls.
        keep: is given the value of each control before any is changed.

    Raises:
        DeviceError: it lets nothing be held.
    """
    held = HeldControls(device, {})
    try:
        try:
            held.read()
            keep(held.found)
            held.hold()
        except OSError as error:
            what = f"the webcam's controls cannot be read: {error.strerror}"
            raise DeviceError(what, "unplug it and plug it in again") from error
        if EXPOSURE_MODE not in held.found and EXPOSURE_TIME not in held.found and GAIN not in held.found:
            what = "the webcam has no controls by which its exposure can be held"
            raise DeviceError(what, "use another webcam; the instant capture works with this one")
        yield held
    finally:
        held.restore()


@contextmanager
def open_controls(node: str) -> Iterator[ControlDevice]:
    """The controls of a device node such as /dev/video0.

    Raises:
        DeviceError: the node cannot be opened, or the system has no V4L2.
    """
    if not sys.platform.startswith("linux") or not Path(node).exists():
        what = "the webcam's controls can only be held on Linux, on a webcam that is plugged in"
        raise DeviceError(what, "the instant capture works without")
    try:
        descriptor = os.open(node, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        raise DeviceError(f"{node} cannot be opened: {error.strerror}", "see what holds it: relit doctor") from error
    try:
        yield V4l2Controls(descriptor)
    finally:
        os.close(descriptor)


def find_exposure(held: HeldControls, brightness: Callable[[], float], target: float, frame_s: float) -> float:
    """Find exposure and gain at which a measured brightness comes nearest to a target, without passing it by much.

    The exposure stays below the time of a frame, so that the rate stays as it is; only where that is too dark, the gain
    is raised.

    Args:
        held: the webcam's controls.
        brightness: waits until a setting shows in the frames, and measures one.
        target: of the brightness.
        frame_s: time between two frames.

    Returns:
        The brightness that was reached.
    """
    reached = brightness()
    longest = round(frame_s / EXPOSURE_UNIT_S)
    exposure, gain = held.ranges.get(EXPOSURE_TIME), held.ranges.get(GAIN)
    if gain is not None:
        held.set(GAIN, gain.least)
        reached = brightness()
    if exposure is not None:
        reached = _bisect(
            lambda value: held.set(EXPOSURE_TIME, value),
            exposure.least,
            min(exposure.most, longest),
            brightness,
            target,
        )
    if gain is not None and reached < 0.8 * target:
        reached = _bisect(lambda value: held.set(GAIN, value), gain.least, gain.most, brightness, target)
    return reached


def _bisect(
    set_value: Callable[[int], object], least: int, most: int, brightness: Callable[[], float], target: float
) -> float:
    """Set the largest value whose brightness does not pass the target, to a few percent; returns the brightness."""
    low, high = least, most
    set_value(high)
    reached = brightness()
    if reached <= target:
        return reached
    for _ in range(_SEARCH_STEPS):
        if high - low <= 1:
            break
        # In stops, since exposures differ by factors.
        middle = max(low + 1, min(high - 1, round((max(low, 1) * max(high, 1)) ** 0.5)))
        set_value(middle)
        if brightness() <= target:
            low = middle
        else:
            high = middle
    set_value(low)
    return brightness()


_SEARCH_STEPS = 7
