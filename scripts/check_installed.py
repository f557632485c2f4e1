"""Checks an installed Relit Camera against this checkout: run it with the Python of the environment to check.

The wheel must hold every file of the package, byte for byte, data and licences too; its plug-ins must load;
its own licence must be with it; its demonstration must show pictures, from a folder and a home that are empty.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from importlib.metadata import distribution
from pathlib import Path
from urllib.request import urlopen

import relit_camera

SOURCE = Path(__file__).resolve().parents[1] / "service" / "relit_camera"
TIME_LIMIT_S = 300.0
"""Within which the demonstration shows pictures and ends, else it is killed."""


def main() -> str | None:
    """Return what is wrong, or None."""
    installed = Path(relit_camera.__file__).parent
    if installed == SOURCE:
        return f"{sys.executable} uses the checkout itself: install a wheel there"
    for path in SOURCE.rglob("*"):
        if path.is_dir() or "__pycache__" in path.parts:
            continue
        copy = installed / path.relative_to(SOURCE)
        if not copy.is_file() or copy.read_bytes() != path.read_bytes():
            return f"{copy} is missing or not as in the checkout"
    package = distribution("relit-camera")
    for point in package.entry_points:
        point.load()
    if not any(file.name == "LICENSE" and file.read_text() for file in package.files or ()):
        return "the wheel has no LICENSE"
    if not _shows_pictures():
        return "its demonstration does not show pictures and end"
    print(f"relit-camera {package.version} in {installed.parent}: {len(package.entry_points)} entry points load")
    return None


def _shows_pictures() -> bool:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("RELIT_", "XDG_", "PYTHON"))}
    command = [str(Path(sys.executable).parent / "relit"), "demo", "--headless", "--port", "0"]
    said, shown = "", False
    with (
        tempfile.TemporaryDirectory() as empty,
        subprocess.Popen(  # noqa: S603 - our own command
            command,
            cwd=empty,
            env={**kept, "HOME": empty},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as demo,
    ):
        assert demo.stdout is not None
        hung = threading.Timer(TIME_LIMIT_S, demo.kill)
        hung.start()
        try:
            for line in demo.stdout:
                said += line
                if "the panel is at " in line:
                    url = line.split()[-1]
                if "First picture" in line:
                    with suppress(OSError):  # it has ended, or was killed
                        first = _picture(url)
                        while _picture(url) == first:
                            time.sleep(0.1)
                        shown = True
                    demo.terminate()
            ended_well = demo.wait() == 0
        finally:
            hung.cancel()
            demo.kill()  # where this is interrupted
    if ended_well and shown:
        return True
    print(said, file=sys.stderr)
    return False


def _picture(url: str) -> bytes:
    with urlopen(f"{url}api/v1/snapshot.jpg", timeout=TIME_LIMIT_S) as answer:  # noqa: S310 - our own server
        return bytes(answer.read())


if __name__ == "__main__":
    sys.exit(main())
