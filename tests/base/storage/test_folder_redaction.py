"""What others may read of paths on this machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.base.storage.folder_redaction import redact_folders


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (f"cannot write {Path.home()}/My Pictures/a.yaml: full", "cannot write My Pictures/a.yaml: full"),
        ("no picture at /mnt/data/x.png", "no picture at x.png"),
        ("'/var/lib/relit/a.hdr' is black", "'a.hdr' is black"),
        (r"no file C:\Users\Ada\cam.relit", "no file cam.relit"),
        ("/dev/video0 is busy", "video0 is busy"),
        ("GET /api/v1/status says why", "GET /api/v1/status says why"),
        ("use .hdr and/or .exr, 16/9", "use .hdr and/or .exr, 16/9"),
        ("see http://127.0.0.1:8470/panel/", "see http://127.0.0.1:8470/panel/"),
    ],
)
def test_folders_of_this_machine_are_taken_out(text: str, shown: str) -> None:
    assert redact_folders(text) == shown
