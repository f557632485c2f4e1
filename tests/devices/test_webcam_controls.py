"""Holding a webcam's controls: what is automatic stops, and everything is put back whatever happens."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from relit_camera.base.errors import DeviceError
from relit_camera.devices.v4l2 import (
    V4L2_CONTROL,
    V4L2_QUERYCTRL,
    VIDIOC_G_CTRL,
    VIDIOC_QUERYCTRL,
    VIDIOC_S_CTRL,
    ControlRange,
)
from relit_camera.devices.webcam_controls import (
    AUTO_GAIN,
    AUTO_WHITE_BALANCE,
    EXPOSURE_MODE,
    EXPOSURE_TIME,
    GAIN,
    WHITE_BALANCE_TEMPERATURE,
    find_exposure,
    hold_controls,
    open_controls,
)

AUTO = 3
"""V4L2_EXPOSURE_APERTURE_PRIORITY, the automatic of most webcams."""


class FakeWebcam:
    """Controls in memory, as the UVC driver has them: while a control is automatic its value cannot be set."""

    def __init__(self, *without: int) -> None:
        self.ranges = {
            EXPOSURE_MODE: ControlRange("Auto Exposure", 0, 3, 1, AUTO),
            EXPOSURE_TIME: ControlRange("Exposure Time, Absolute", 3, 2047, 1, 250),
            GAIN: ControlRange("Gain", 0, 255, 1, 64),
            AUTO_WHITE_BALANCE: ControlRange("White Balance, Automatic", 0, 1, 1, 1),
            WHITE_BALANCE_TEMPERATURE: ControlRange("White Balance Temperature", 2800, 6500, 100, 4600),
        }
        self.values = {
            EXPOSURE_MODE: AUTO,
            EXPOSURE_TIME: 312,
            GAIN: 100,
            AUTO_WHITE_BALANCE: 1,
            WHITE_BALANCE_TEMPERATURE: 5300,
        }
        for control in without:
            del self.ranges[control], self.values[control]
        self.unplugged = False

    def query(self, control: int) -> ControlRange | None:
        self._check()
        return self.ranges.get(control)

    def get(self, control: int) -> int:
        self._check()
        return self.values[control]

    def set(self, control: int, value: int) -> None:
        self._check()
        allowed = self.ranges[control]
        assert allowed.least <= value <= allowed.most
        assert (value - allowed.least) % allowed.step == 0
        owner = {EXPOSURE_TIME: (EXPOSURE_MODE, 1), WHITE_BALANCE_TEMPERATURE: (AUTO_WHITE_BALANCE, 0)}.get(control)
        if owner and owner[0] in self.values and self.values[owner[0]] != owner[1]:
            raise OSError(errno.EACCES, "inactive")
        self.values[control] = value

    def _check(self) -> None:
        if self.unplugged:
            raise OSError(errno.ENODEV, "No such device")

    def brightness(self, light: float = 0.8) -> float:
        """Of its pictures: linear in exposure, up to white."""
        return min(255.0, self.values[EXPOSURE_TIME] * (1 + self.values.get(GAIN, 0) / 64) * light)


def test_what_is_automatic_stops_at_the_values_that_it_had() -> None:
    webcam = FakeWebcam()
    with hold_controls(webcam) as held:
        assert webcam.values[EXPOSURE_MODE] == 1
        assert webcam.values[AUTO_WHITE_BALANCE] == 0
        assert webcam.values[WHITE_BALANCE_TEMPERATURE] == 5300
        assert webcam.values[EXPOSURE_TIME] == 312
        assert "Gain" in held.names


@pytest.mark.parametrize("fault", [None, RuntimeError("a fault"), KeyboardInterrupt()])
def test_everything_is_put_back_whatever_happens(fault: BaseException | None) -> None:
    webcam = FakeWebcam()
    before = dict(webcam.values)

    def capture() -> None:
        with hold_controls(webcam) as held:
            held.set(EXPOSURE_TIME, 50)
            held.set(GAIN, 7)
            held.set(WHITE_BALANCE_TEMPERATURE, 3000)
            if fault:
                raise fault

    if fault:
        with pytest.raises(type(fault)):
            capture()
    else:
        capture()
    assert webcam.values == before


def test_manual_settings_of_the_person_come_back_too() -> None:
    webcam = FakeWebcam()
    webcam.values |= {EXPOSURE_MODE: 1, EXPOSURE_TIME: 77}
    with hold_controls(webcam) as held:
        held.set(EXPOSURE_TIME, 500)
    assert webcam.values[EXPOSURE_MODE] == 1
    assert webcam.values[EXPOSURE_TIME] == 77


def test_a_webcam_that_is_unplugged_meanwhile_does_not_hide_the_error() -> None:
    webcam = FakeWebcam()

    def capture() -> None:
        with hold_controls(webcam):
            webcam.unplugged = True
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        capture()


def test_a_webcam_without_controls_is_told() -> None:
    webcam = FakeWebcam(EXPOSURE_MODE, EXPOSURE_TIME, GAIN)
    with pytest.raises(DeviceError, match="no controls by which its exposure can be held"), hold_controls(webcam):
        pytest.fail("it was held")
    assert webcam.values[AUTO_WHITE_BALANCE] == 1
    webcam.unplugged = True
    with pytest.raises(DeviceError, match="cannot be read: No such device"), hold_controls(webcam):
        pytest.fail("it was held")


def test_values_are_kept_within_their_range_and_steps() -> None:
    webcam = FakeWebcam()
    with hold_controls(webcam) as held:
        assert held.set(WHITE_BALANCE_TEMPERATURE, 4149)
        assert webcam.values[WHITE_BALANCE_TEMPERATURE] == 4100
        assert held.set(EXPOSURE_TIME, 10**9)
        assert webcam.values[EXPOSURE_TIME] == 2047
        assert not held.set(AUTO_GAIN, 0)


def test_the_exposure_is_found_without_leaving_the_frame_rate() -> None:
    webcam = FakeWebcam()
    with hold_controls(webcam) as held:
        reached = find_exposure(held, webcam.brightness, 200, 1 / 30)
        assert 160 < reached <= 200
        assert webcam.values[EXPOSURE_TIME] <= 333
        assert webcam.values[GAIN] == 0


def test_gain_helps_only_where_the_longest_exposure_is_too_dark() -> None:
    webcam = FakeWebcam()
    with hold_controls(webcam) as held:
        reached = find_exposure(held, lambda: webcam.brightness(0.3), 200, 1 / 30)
        assert webcam.values[EXPOSURE_TIME] == 333
        assert webcam.values[GAIN] > 0
        assert 160 < reached <= 200
    assert webcam.values[GAIN] == 100


def test_the_calls_are_those_of_the_kernel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Against a kernel in memory: requests, structures and flags."""
    values = {GAIN: 9}
    flags = {GAIN: 0, EXPOSURE_TIME: 0x1}

    def ioctl(descriptor: int, request: int, argument: bytearray) -> int:
        os.fstat(descriptor)
        if request == VIDIOC_QUERYCTRL:
            assert len(argument) == 68
            control = V4L2_QUERYCTRL.unpack(argument)[0]
            if control not in flags:
                raise OSError(errno.EINVAL, "Invalid argument")
            argument[:] = V4L2_QUERYCTRL.pack(control, 1, b"Gain\0rest", 0, 63, 0, 32, flags[control])
            return 0
        control, value = V4L2_CONTROL.unpack(argument)
        if request == VIDIOC_S_CTRL:
            values[control] = value
        else:
            assert request == VIDIOC_G_CTRL
            argument[:] = V4L2_CONTROL.pack(control, values[control])
        return 0

    monkeypatch.setattr("relit_camera.devices.v4l2.fcntl.ioctl", ioctl)
    node = tmp_path / "video7"
    node.touch()
    with open_controls(str(node)) as device:
        assert device.query(GAIN) == ControlRange("Gain", 0, 63, 1, 32)
        assert device.query(EXPOSURE_TIME) is None  # disabled
        assert device.query(AUTO_GAIN) is None
        device.set(GAIN, 41)
        assert device.get(GAIN) == 41


def test_a_node_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="plugged in"), open_controls(str(tmp_path / "video9")):
        pytest.fail("it was opened")
