"""Programs that show the virtual camera, and what they get."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np

from relit_camera.base.images.image_types import DisplayImage
from tests.vm.camera import START_S, started
from tests.vm.machine import Command, Machine, MachineError, by_user, wait_until

NODE = "/dev/video10"
LABEL = "Relit Camera"
FRAMES = 8


@dataclass(frozen=True)
class Seen:
    """What a reader got.

    Attributes:
        format: as the reader names it.
        image: the last picture, uint8 sRGB RGB (height, width, 3).
    """

    format: str
    image: DisplayImage


def finds_label(machine: Machine) -> dict[str, bool]:
    """Whether each program that lists cameras lists ours by its label, at its node."""
    v4l2_ctl = machine.run("v4l2-ctl --list-devices", check=False).output
    ffmpeg = machine.run("ffmpeg -hide_banner -sources v4l2", check=False).text
    return {
        "v4l2-ctl": re.search(rf"^{LABEL} .*:\n\s+{NODE}$", v4l2_ctl, re.MULTILINE) is not None,
        "ffmpeg": re.search(rf"{NODE} \[{LABEL}\]", ffmpeg) is not None,
    }


def read_by_v4l2_ctl(machine: Machine) -> Seen:
    """Read with v4l2-ctl, whose exit status says nothing: what it wrote does."""
    raw = machine.host / "v4l2.raw"
    raw.unlink(missing_ok=True)
    stream = f"--stream-mmap --stream-count={FRAMES} --stream-to=/host/{raw.name}"
    described = machine.run(f"timeout 60 v4l2-ctl -d {NODE} --get-fmt-video {stream}").output
    width, height = map(int, re.search(r"Width/Height\s*: (\d+)/(\d+)", described).groups())  # type: ignore[union-attr]
    layout = re.search(r"Pixel Format\s*: '(\w+)'", described)[1]  # type: ignore[index]
    assert layout == "YU12", described
    frames = np.fromfile(raw, np.uint8).reshape(-1, height * 3 // 2, width)
    assert len(frames) == FRAMES
    return Seen(f"{layout} {width}x{height}", _rgb(frames[-1], cv2.COLOR_YUV2RGB_I420))


def read_by_ffmpeg(machine: Machine) -> Seen:
    """Read with ffmpeg."""
    read = f"timeout 60 ffmpeg -hide_banner -f v4l2 -i {NODE} -frames:v {FRAMES} -update 1 -y /host/ffmpeg.png"
    said = machine.run(read).errors
    video = re.search(r"Video: \w+ \((\w+).*?, (\w+), (\d+x\d+)", said)
    assert video is not None, said
    return Seen(f"{video[1]}, {video[2]} {video[3]}", picture(machine.host / "ffmpeg.png"))


def read_by_opencv(machine: Machine) -> Seen:
    """Read with OpenCV's VideoCapture."""
    outcome = started(machine, f"exec python3 /host/guest/watch.py {NODE} /host/opencv {FRAMES}").wait()
    if outcome.status:
        raise MachineError(outcome.text)
    said = outcome.output
    image = picture(machine.host / "opencv.png")
    return Seen(f"{said.strip()} {image.shape[1]}x{image.shape[0]}", image)


READERS: dict[str, Callable[[Machine], Seen]] = {
    "v4l2-ctl": read_by_v4l2_ctl,
    "ffmpeg": read_by_ffmpeg,
    "OpenCV": read_by_opencv,
}
"""Those that start at once; Chromium is a `Call`."""


class Watcher:
    """OpenCV, reading until it is told to stop."""

    def __init__(self, machine: Machine, name: str) -> None:
        """Begin; `name` is that of its files. It ends with its `with` at the latest."""
        self._out = machine.host / name
        self._command = started(machine, f"exec python3 /host/guest/watch.py {NODE} /host/{name}")

    def rows(self) -> list[dict[str, Any]]:
        """The pictures so far: when, number, size."""
        return _rows(self._out.with_suffix(".jsonl"))

    def wait_for(self, pictures: int, after: int = 0, within_s: float = 60.0) -> list[dict[str, Any]]:
        """Wait for so many pictures after that many, and return these."""

        def enough() -> list[dict[str, Any]] | None:
            if self._command.ended:
                raise MachineError(f"OpenCV ended: {self._command.wait().text}")
            rows = self.rows()[after:]
            return rows if len(rows) >= pictures else None

        found: list[dict[str, Any]] = wait_until(enough, within_s, f"OpenCV read {pictures} pictures")
        return found

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if not self._command.ended:
            self._command.kill()

    def stop(self) -> DisplayImage:
        """End it, and return its last picture."""
        self._out.with_suffix(".stop").touch()
        self._command.wait()
        return picture(self._out.with_suffix(".png"))


class Call:
    """A call in headless Chromium, held until it is told to stop."""

    def __init__(self, machine: Machine, name: str, label: str = LABEL) -> None:
        """Begin; `name` is that of its files. It ends with its `with` at the latest."""
        self._out = machine.host / name
        call = f"exec python3 /host/guest/call.py '{label}' /host/{name} 1200"
        self._command: Command = machine.start(by_user(call), timeout_s=1800.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if not self._command.ended:
            self._command.kill()

    def rows(self) -> list[dict[str, Any]]:
        """The call's state, a row a second."""
        return _rows(self._out.with_suffix(".jsonl"))

    def wait_for_frames(self, more: int, within_s: float = START_S) -> None:
        """Wait until the page has shown so many frames more."""
        before = self._frames()
        wait_until(lambda: self._command.ended or self._frames() >= before + more, within_s, f"Chromium showed {more}")
        if self._command.ended:
            raise MachineError(f"Chromium ended: {self._command.wait().text}")

    def stop(self, keep: Path | None = None) -> tuple[dict[str, Any], DisplayImage]:
        """End it. Returns what the page found (the cameras, and the chosen one's label), and its last picture.

        Args:
            keep: where to keep the screenshot, a PNG file.
        """
        self._out.with_suffix(".stop").touch()
        outcome = self._command.wait()
        assert outcome.status == 0, outcome.text
        if keep is not None:
            shutil.copyfile(self._out.with_name(f"{self._out.name}-page.png"), keep)
        return json.loads(outcome.output), picture(self._out.with_suffix(".png"))

    def _frames(self) -> int:
        rows = self.rows()
        return rows[-1]["frames"] if rows else 0


def picture(path: Path) -> DisplayImage:
    """Read a picture, uint8 sRGB RGB."""
    read = cv2.imread(str(path))
    assert read is not None, path
    return _rgb(read, cv2.COLOR_BGR2RGB)


def difference(image: DisplayImage, expected: DisplayImage) -> int:
    """The largest difference in code values, away from edges: there 4:2:0 blurs colours, each reader in its own way."""
    assert image.shape == expected.shape
    box = np.ones((9, 9), np.uint8)
    is_flat = (cv2.dilate(expected, box).astype(int) - cv2.erode(expected, box) < 12).all(axis=2)
    assert is_flat.mean() > 0.2
    return int(np.abs(image.astype(int) - expected)[is_flat].max())


def _rgb(image: np.ndarray, code: int) -> DisplayImage:
    converted: DisplayImage = cv2.cvtColor(image, code)
    return converted


def _rows(path: Path) -> list[dict[str, Any]]:
    whole = path.read_text().rpartition("\n")[0].splitlines() if path.exists() else []
    return [json.loads(line) for line in whole]
