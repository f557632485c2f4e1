"""A device tree in a folder, laid out as Linux does, and cameras that exist only in memory."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np

from relit_camera.devices.device_discovery import DeviceFolders


class FakeTree(DeviceFolders):
    """Sysfs and /dev under one folder; devices come and go by method."""

    def __init__(self, root: Path) -> None:
        super().__init__(root / "sys", root / "dev")
        (self.sys / "class" / "video4linux").mkdir(parents=True)
        (self.dev / "v4l" / "by-id").mkdir(parents=True)

    def add_webcam(self, number, name, usb="1-2:1.0", by_id=None, index=0):
        device = self.sys / "devices" / "pci0000:00" / "usb1" / usb.split(":")[0] / usb
        self._add(number, device, name, index)
        if by_id:
            (self.dev / "v4l" / "by-id" / by_id).symlink_to(f"../../video{number}")

    def add_loopback(self, number, label, size=None, state=None):
        folder = self._add(number, self.sys / "devices" / "virtual", label, 0)
        (folder / "format").write_text(f"YU12:{size[0]}x{size[1]}@30\n" if size else "\n")
        if state:
            (folder / "state").write_text(state)
        return str(self.dev / f"video{number}")

    def set_format(self, number, text):
        (self.sys / "class" / "video4linux" / f"video{number}" / "format").write_text(text)

    def remove(self, number):
        (self.sys / "class" / "video4linux" / f"video{number}").unlink()
        (self.dev / f"video{number}").unlink()
        for link in (self.dev / "v4l" / "by-id").iterdir():
            if not link.exists():
                link.unlink()

    def _add(self, number, device, name, index):
        folder = device / "video4linux" / f"video{number}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "name").write_text(name + "\n")
        (folder / "index").write_text(f"{index}\n")
        (self.sys / "class" / "video4linux" / folder.name).symlink_to(folder)
        (self.dev / folder.name).touch()
        return folder


class FakeCapture:
    """Stands for `cv2.VideoCapture`: gives BGR pictures at a rate until told otherwise.

    `mode`: "ok"; "silent" (reads fail after a while, as V4L2's do); "stuck" (a read never answers until released).
    """

    def __init__(self, mode="ok", size=(64, 48), opened=True, interval_s=0.01):
        self.mode, self.opened, self.released, self.interval_s = mode, opened, False, interval_s
        self.picture = np.zeros((size[1], size[0], 3), np.uint8)
        self.picture[:] = (10, 20, 200)  # BGR
        self.threads: set[int] = set()
        self.is_stuck, self.unstick = threading.Event(), threading.Event()

    def isOpened(self):
        self.threads.add(threading.get_ident())
        return self.opened

    def read(self):
        self.threads.add(threading.get_ident())
        if self.mode == "stuck":
            self.is_stuck.set()
            self.unstick.wait(60)
            return False, None
        time.sleep(self.interval_s)
        return (True, self.picture.copy()) if self.mode == "ok" else (False, None)

    def release(self):
        self.threads.add(threading.get_ident())
        self.released = True
