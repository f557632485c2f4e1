"""Nothing leaves this machine: ONNX Runtime's own telemetry is off before it is loaded."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

OPENS_A_NETWORK = """
from relit_camera.base.config.settings import RelitSettings
from relit_camera.doctor.models_and_subject import check_provider
assert check_provider(RelitSettings(inference={"provider": "cpu"})).state == "ok"
"""


@pytest.mark.slow
def test_opening_a_network_writes_nothing_into_the_users_home(tmp_path: Path) -> None:
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "ORT_", "RELIT_"))}
    environment = {**kept, "HOME": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([sys.executable, "-c", OPENS_A_NETWORK], env=environment, check=True, timeout=120)
    assert [str(path) for path in tmp_path.rglob("*")] == []
