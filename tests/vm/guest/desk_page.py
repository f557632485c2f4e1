"""The page of a desk capture, as far as the camera hears of it: desk_page.py NODE OUT CONTROL,….

It asks for a capture, and says several times a second that it shows what it is told to. Meanwhile it notes in
OUT.jsonl, a line each time, the capture's status and the values of the webcam's controls, as v4l2-ctl reads them. It
ends when the camera needs no page any more.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path
from typing import Any, TextIO

ADDRESS = "http://127.0.0.1:8470/api/v1/captures/desk"
ANSWER_S = 120
"""On a busy emulated machine."""
PLACE = {"screen_width_cm": 58.5, "screen_height_cm": 34.4, "distance_cm": 60, "camera_up_cm": 18}


def ask(method: str, path: str, body: dict[str, Any]) -> dict[str, Any]:
    """Answer of the API."""
    request = urllib.request.Request(ADDRESS + path, json.dumps(body).encode(), {"Content-Type": "application/json"})
    request.method = method
    with urllib.request.urlopen(request, timeout=ANSWER_S) as answer:
        found: dict[str, Any] = json.load(answer)
    return found


def controls(node: str, names: str) -> dict[str, int]:
    """Their values by name."""
    if not names:
        return {}
    read = subprocess.run(["v4l2-ctl", "-d", node, "-C", names], capture_output=True, text=True, check=True)
    lines = [line.partition(": ") for line in read.stdout.splitlines()]
    return {name: int(value.split()[0]) for name, _, value in lines}


class Page:
    """Shows the capture's steps, in a thread of its own: reading controls takes seconds on a busy machine."""

    def __init__(self) -> None:
        self.status = ask("POST", "", PLACE)
        threading.Thread(target=self._show, daemon=True).start()

    @property
    def is_needed(self) -> bool:
        """Whether the capture needs a page."""
        return self.status["stage"] in ("exposing", "filming")

    def _show(self) -> None:
        try:
            while self.is_needed:
                self.status = ask("PUT", "/shown", {"step": self.status["step"]})
                time.sleep(0.1)
        except OSError as error:
            print(f"the camera does not answer: {error}", file=sys.stderr, flush=True)
            os._exit(1)


def main(node: str, out: str, names: str = "") -> None:
    """Be the page until it is needed no more."""
    page = Page()
    with Path(f"{out}.jsonl").open("w") as rows:
        while page.is_needed:
            note(page, node, names, rows)
            time.sleep(0.1)
        note(page, node, names, rows)


def note(page: Page, node: str, names: str, rows: TextIO) -> None:
    """Write a row, unless the stage changes while the controls are read."""
    before, read, after = page.status, controls(node, names), page.status
    if before["stage"] == after["stage"]:
        print(json.dumps({**after, "controls": read}), file=rows, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
