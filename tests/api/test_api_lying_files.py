"""Files that lie, sent to the camera: each is refused in words, costs little, and leaves nothing behind."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.api.api_client import Client, check_problem
from tests.api.fake_camera import FakeCamera
from tests.fuzz.lying_files import FINDS

COLLECTIONS = {"picture": "backgrounds", "hdr": "environments", "exr": "environments", "subject": "subjects"}
SENT = [name for name, file in FINDS.items() if file.kind in COLLECTIONS]
READABLE = {"png with a packed comment", "png, animated"}
"""Decoders skip what is too much in them."""


def stored(camera: FakeCamera) -> list[Path]:
    folder = camera.scene_controller.environments.folder.parent
    return [path for path in folder.rglob("*") if path.is_file()]


@pytest.mark.slow
@pytest.mark.parametrize("name", SENT)
def test_a_file_that_lies_is_refused_at_once(client: Client, camera: FakeCamera, name: str) -> None:
    file = FINDS[name]
    data = file.make()
    client.upload("/api/v1/backgrounds", "x", b"GIF", "a.png")  # the process that decodes is there
    began = time.process_time()
    answer = client.upload(f"/api/v1/{COLLECTIONS[file.kind]}", "lie", data, f"a{file.suffix}")
    assert time.process_time() - began < 3  # of which most is the test's own client
    if name in READABLE:
        assert answer.status_code == 201
        return
    problem = check_problem(answer, 422)
    assert problem["what"]
    assert problem["cure"]
    assert stored(camera) == []
