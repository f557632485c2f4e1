"""A USB webcam with automatic exposure and white balance, made of software: usb_webcam.py SCENE_LIGHT [plain].

It answers the requests of USB Video Class 1.0 over the kernel's virtual bus (vhci_hcd), so that the kernel's own driver
of webcams (uvcvideo) is in charge of it. Its picture is one gray, as bright as the light of the scene, exposure time
and gain make it: code = light * exposure * (1 + gain / 64), exposure in 0.1 ms. While exposure or white balance are
automatic, it chooses the values itself and refuses others', as webcams do. A plain one keeps its automatics to
itself: it has no controls. It is unplugged when this process ends.

Root runs it. Documentation/usb/usbip_protocol.rst of the kernel describes the bus; sections are of "USB Device Class
Definition for Video Devices", revision 1.1.
"""

from __future__ import annotations

import socket
import struct
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

SIZE, FPS = (320, 180), 10
ATTACH = Path("/sys/devices/platform/vhci_hcd.0/attach")
PORT, DEVICE, HIGH_SPEED = 0, 0x10002, 3
STALL, UNLINKED = -32, -104
"""-EPIPE and -ECONNRESET."""

SUBMIT, UNLINK, SUBMITTED, UNLINKED_REPLY = 1, 2, 3, 4
HEADER = struct.Struct(">5I")
"""Of each message: command, number, device, direction (1 to the host), endpoint."""
REQUEST = struct.Struct(">5i8s")
"""Of a submitted request: flags, length, start frame, packets, interval, setup packet."""
REPLY = struct.Struct(">5i8x")
"""status, length, start frame, packets, errors."""

SET_CUR, GET_CUR, GET_MIN, GET_MAX, GET_RES, GET_LEN, GET_INFO, GET_DEF = 0x01, *range(0x81, 0x88)
CAMERA, PROCESSING, OUTPUT = 1, 2, 3
"""Terminals and units."""
EXPOSURE_MODE, EXPOSURE_TIME = (CAMERA, 0x02), (CAMERA, 0x04)
GAIN, WHITE_BALANCE, AUTO_WHITE_BALANCE = (PROCESSING, 0x04), (PROCESSING, 0x0A), (PROCESSING, 0x0B)
"""Unit and control selector."""
MANUAL, AUTOMATIC = 1, 8
"""Of the exposure mode; 8 is "aperture priority", which webcams call their automatic."""
TARGET_CODE, CHOSEN_KELVIN = 110, 5300
"""What the automatics aim at, and find."""


@dataclass
class Control:
    """A control.

    Attributes:
        layout: of its value.
        value, least, most, step: in its own unit.
        default: of the value.
        owner: the control by which it is automatic, and the value at which it is not.
    """

    layout: str
    value: int
    least: int
    most: int
    step: int
    default: int
    owner: tuple[tuple[int, int], int] | None = None


class Webcam:
    """The device."""

    def __init__(self, light: float, plain: bool) -> None:
        self.light, self.plain = light, plain
        self.controls = {
            EXPOSURE_MODE: Control("<B", AUTOMATIC, 0, 0, MANUAL | AUTOMATIC, AUTOMATIC),
            EXPOSURE_TIME: Control("<I", 0, 3, 2047, 1, 250, (EXPOSURE_MODE, MANUAL)),
            GAIN: Control("<H", 10, 0, 255, 1, 0),
            WHITE_BALANCE: Control("<H", CHOSEN_KELVIN, 2800, 6500, 10, 4600, (AUTO_WHITE_BALANCE, 0)),
            AUTO_WHITE_BALANCE: Control("<B", 1, 0, 1, 1, 1),
        }
        self.format = probe()
        self.adapt()

    def adapt(self) -> None:
        """Let the automatics choose."""
        exposure = self.controls[EXPOSURE_TIME]
        if self.controls[EXPOSURE_MODE].value != MANUAL:
            wanted = TARGET_CODE / (self.light * self.gain())
            exposure.value = min(max(round(wanted), exposure.least), exposure.most)
        if self.controls[AUTO_WHITE_BALANCE].value:
            self.controls[WHITE_BALANCE].value = CHOSEN_KELVIN

    def gain(self) -> float:
        """The factor that the gain is."""
        return 1 + self.controls[GAIN].value / 64

    def code(self) -> int:
        """The gray of its picture."""
        return min(round(self.light * self.controls[EXPOSURE_TIME].value * self.gain()), 255)

    def answer(self, setup: bytes, data: bytes) -> bytes | None:
        """The answer to a control request with its setup packet (9.3 of USB 2.0); None refuses it."""
        kind, request, value, index, length = struct.unpack("<BBHHH", setup)
        if kind == 0x80 and request == 6:
            found = descriptor(value, self.plain)
        elif kind in (0x80, 0x81) and request == 0:  # status
            found = b"\0\0"
        elif kind == 0x81 and request == 10:  # alternate setting
            found = b"\0"
        elif kind in (0x00, 0x01, 0x02):  # address, configuration, interface, halt
            found = b""
        elif kind in (0x21, 0xA1):
            found = self._of_class(request, value >> 8, index >> 8, data)
        else:
            found = None
        return None if found is None else found[:length]

    def _of_class(self, request: int, selector: int, unit: int, data: bytes) -> bytes | None:
        """A request of the video class (4.2): of the stream's format, or of a control."""
        if unit == 0 and selector in (1, 2):  # probe and commit
            if request == SET_CUR:
                return b""
            return {GET_LEN: struct.pack("<H", len(self.format)), GET_INFO: b"\3"}.get(request, self.format)
        control = self.controls.get((unit, selector))
        if control is None:
            return None
        owned = control.owner is not None and self.controls[control.owner[0]].value != control.owner[1]
        if request == SET_CUR:
            (value,) = struct.unpack(control.layout, data)
            if owned:
                return None
            control.value = value
            self.adapt()
            return b""
        if request == GET_LEN:
            return struct.pack("<H", struct.calcsize(control.layout))
        if request == GET_INFO:
            return bytes([3 | (4 if owned else 0)])  # "disabled due to automatic mode"
        told = {GET_CUR: control.value, GET_MIN: control.least, GET_MAX: control.most}
        told |= {GET_RES: control.step, GET_DEF: control.default}
        return struct.pack(control.layout, told[request]) if request in told else None


PAYLOAD_BYTES, PAYLOAD_HEADER_BYTES = 16384, 2
FRAME_BYTES = SIZE[0] * SIZE[1] * 2
END_OF_FRAME = 2


def probe() -> bytes:
    """The one format of the stream (4.3.1.1): first format, first frame size, its interval."""
    return struct.pack("<HBBI5HII", 1, 1, 1, 10_000_000 // FPS, 0, 0, 0, 0, 0, FRAME_BYTES, PAYLOAD_BYTES)


def descriptor(which: int, plain: bool) -> bytes | None:
    """The descriptor of a kind and index (3.1 to 3.10)."""
    kind, index = which >> 8, which & 0xFF
    if kind == 1:
        return struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x200, 0xEF, 2, 1, 64, 0x1D6B, 0x0102, 1, 1, 2, 0, 1)
    if kind == 2:
        return configuration(plain)
    if kind == 3:
        text = {1: "Relit", 2: "Test Webcam"}.get(index, "")
        body = text.encode("utf-16-le") if index else struct.pack("<H", 0x409)
        return bytes([2 + len(body), 3]) + body
    return None


def configuration(plain: bool) -> bytes:
    """One control interface and one streaming interface, whose pictures come through a bulk endpoint."""
    exposure = 0 if plain else 1 << 1 | 1 << 3
    processing = 0 if plain else 1 << 6 | 1 << 9 | 1 << 12
    units = struct.pack("<BBBBHBBHHHB3s", 18, 0x24, 2, CAMERA, 0x0201, 0, 0, 0, 0, 0, 3, exposure.to_bytes(3, "little"))
    units += struct.pack("<BBBBBHBHB", 11, 0x24, 5, PROCESSING, CAMERA, 0, 2, processing, 0)
    units += struct.pack("<BBBBHBBB", 9, 0x24, 3, OUTPUT, 0x0101, 0, PROCESSING, 0)
    control = struct.pack("<9B", 9, 4, 0, 0, 0, 0x0E, 1, 0, 0)
    control += struct.pack("<BBBHHIBB", 13, 0x24, 1, 0x100, 13 + len(units), 6_000_000, 1, 1) + units
    guid = b"YUY2\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71"
    formats = struct.pack("<BBBBB16s6B", 27, 0x24, 4, 1, 1, guid, 16, 1, 0, 0, 0, 0)
    rate, interval = FRAME_BYTES * 8 * FPS, 10_000_000 // FPS
    formats += struct.pack("<BBBBBHHIIIIBI", 30, 0x24, 5, 1, 0, *SIZE, rate, rate, FRAME_BYTES, interval, 1, interval)
    formats += struct.pack("<6B", 6, 0x24, 0x0D, 1, 1, 4)
    streaming = struct.pack("<9B", 9, 4, 1, 0, 1, 0x0E, 2, 0, 0)
    streaming += struct.pack("<BBBBHBBBBBBBB", 14, 0x24, 1, 1, 14 + len(formats), 0x81, 0, OUTPUT, 0, 0, 0, 1, 0)
    streaming += formats + struct.pack("<BBBBHB", 7, 5, 0x81, 2, 512, 0)
    association = struct.pack("<8B", 8, 11, 0, 2, 0x0E, 3, 0, 0)
    body = association + control + streaming
    return struct.pack("<BBHBBBBB", 9, 2, 9 + len(body), 2, 1, 0, 0x80, 250) + body


class Bus:
    """The virtual bus, to which the device is plugged. Frames are sent by a thread of its own, at their rate."""

    def __init__(self, webcam: Webcam) -> None:
        self._webcam = webcam
        self._socket, kernels = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        ATTACH.write_text(f"{PORT} {kernels.fileno()} {DEVICE} {HIGH_SPEED}")
        kernels.close()
        self._waiting: list[int] = []
        self._lock = threading.Condition()
        threading.Thread(target=self._stream, daemon=True).start()

    def serve(self) -> None:
        """Answer until the bus is gone."""
        while head := self._read(HEADER.size):
            command, number, _, direction, endpoint = HEADER.unpack(head)
            # Of an unlinking the first is the number of what is unlinked.
            first, length, _, _, _, setup = REQUEST.unpack(self._read(REQUEST.size))
            if command == UNLINK:
                self._unlink(number, first)
            elif endpoint:
                with self._lock:
                    self._waiting.append(number)
                    self._lock.notify()
            else:
                data = b"" if direction else self._read(length)
                answer = self._webcam.answer(setup, data)
                self._reply(number, STALL if answer is None else 0, answer or b"", 0 if direction else length)

    def _unlink(self, number: int, unlinked: int) -> None:
        with self._lock:
            found = unlinked in self._waiting
            if found:
                self._waiting.remove(unlinked)
            self._socket.sendall(HEADER.pack(UNLINKED_REPLY, number, 0, 0, 0) + struct.pack(">i24x", UNLINKED * found))

    def _reply(self, number: int, status: int, data: bytes, written: int = 0) -> None:
        reply = REPLY.pack(status, written or len(data), 0, 0, 0)
        with self._lock:
            self._socket.sendall(HEADER.pack(SUBMITTED, number, 0, 0, 0) + reply + data)

    def _stream(self) -> None:
        """Send frames, each in several payloads (2.4.3), while the host asks for them."""
        toggle, due = 0, time.monotonic()
        body = PAYLOAD_BYTES - PAYLOAD_HEADER_BYTES
        while True:
            luma = 16 + round(self._webcam.code() * 219 / 255)
            frame = bytes((luma, 128)) * (FRAME_BYTES // 2)
            for start in range(0, FRAME_BYTES, body):
                last = END_OF_FRAME if start + body >= FRAME_BYTES else 0
                payload = bytes((PAYLOAD_HEADER_BYTES, 0x80 | toggle | last)) + frame[start : start + body]
                with self._lock:
                    while not self._waiting:
                        self._lock.wait()
                    # In one hold: who unlinks a request either finds it, or is told that it is answered.
                    self._reply(self._waiting.pop(0), 0, payload)
            toggle ^= 1
            due = max(due + 1 / FPS, time.monotonic())
            time.sleep(max(due - time.monotonic(), 0))

    def _read(self, count: int) -> bytes:
        data = b""
        while len(data) < count and (more := self._socket.recv(count - len(data))):
            data += more
        return data


if __name__ == "__main__":
    Bus(Webcam(float(sys.argv[1]), plain=sys.argv[2:] == ["plain"])).serve()
