"""Fifty changes a second from two clients, with two listeners; the long run is `python -m tests.api.api_load`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.api.api_load import drive
from tests.small_camera import PATIENT, running_camera


@pytest.mark.slow
def test_no_change_is_lost(tmp_path: Path) -> None:
    with running_camera(tmp_path, timings=PATIENT) as camera:
        camera.sink.wait_for(1)
        result = drive(f"{camera.http.base_url.scheme}://{camera.http.base_url.netloc.decode()}/", 2.0)
    assert result.lost == []
    assert (result.sent, result.refused) == (100, 0)
    assert min(result.heard) > 5
    assert min(result.pictures) > 5
