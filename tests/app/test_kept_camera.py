"""A real `relit run` that is killed and started again, and told to end: what its keeper shows meanwhile."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cli.relit_command import Material, environment, write_material
from tests.devices.keeper.stand_in_sink import VARIABLE, Noted, noted, runs
from tests.lateness import Lateness
from tests.small_camera import WAIT_S, wait_until

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="keepers are Linux's")

INJECTED = """
import sys
from relit_camera.devices.keeper import kept_sink
from relit_camera.devices.sinks import sink_factory
from tests.devices.keeper.stand_in_sink import open_noting
kept_sink.KEPT_SINKS["null"] = "null"
sink_factory.open_null = open_noting
sys.argv[0] = "relit"
from relit_camera.cli.main import run
run()
"""
"""`relit` for which the sink `null` is one that a keeper holds, and that notes its pictures."""
LONGEST_GAP_S = 1.0
"""But for what a busy machine makes any process wait. It is two hundred milliseconds where the machine has time."""


@pytest.fixture(scope="module")
def material(tmp_path_factory: pytest.TempPathFactory) -> Material:
    return write_material(tmp_path_factory.mktemp("material"))


@pytest.fixture
def start(tmp_path: Path, material: Material) -> Iterator[Callable[[], subprocess.Popen[str]]]:
    """Starts the camera; returns when it says that it runs."""
    started = []
    # Short, for the path of a socket has some hundred characters at most.
    runtime = Path(subprocess.run(["mktemp", "-d"], capture_output=True, text=True, check=True).stdout.strip())

    def begin() -> subprocess.Popen[str]:
        options = ["--source", material.clip, "--subject", material.subject, "--tracker", material.tracker]
        camera = subprocess.Popen(
            [sys.executable, "-c", INJECTED, "run", *map(str, options), "--sink", "null", "--port", "0"],
            env={
                **environment(tmp_path), VARIABLE: str(tmp_path / "pictures"), "XDG_RUNTIME_DIR": str(runtime),
                "PYTHONPATH": str(Path(__file__).resolve().parents[2]), "RELIT_OUTPUT__KEEP_S": "90",
            },
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        started.append(camera)
        assert camera.stdout is not None
        assert "Relit Camera runs" in camera.stdout.readline()
        return camera

    yield begin
    for camera in started:
        if camera.poll() is None:
            camera.send_signal(signal.SIGTERM)
        camera.communicate(timeout=WAIT_S)


@pytest.fixture
def lateness() -> Iterator[Lateness]:
    """What the machine makes any process wait during the test."""
    with Lateness() as measured:
        yield measured


@pytest.mark.slow
def test_its_virtual_camera_goes_on_through_kill_9_and_ends_when_it_is_told_to(
    tmp_path: Path,
    start: Callable[[], subprocess.Popen[str]],
    lateness: Lateness,
    note_row: Callable[[str, tuple[str, ...]], None],
) -> None:
    def shown() -> list[Noted]:
        return noted(tmp_path / "pictures")

    camera = start()
    wait_until(lambda: len(shown()) > 20)
    camera.kill()
    camera.wait()
    at_death = len(shown())
    wait_until(lambda: len(shown()) > at_death + 10)  # without a camera
    camera = start()
    started = len(shown())
    wait_until(lambda: len(shown()) > started + 20)
    camera.send_signal(signal.SIGTERM)
    assert camera.wait(WAIT_S) == 0
    (keeper,) = {picture.process for picture in shown()}
    wait_until(lambda: not runs(keeper))
    gap_s = lateness.longest_gap_s(picture.at for picture in shown())
    note_row("a camera whose keeper goes on", ("relit run is killed and started again", f"{1e3 * gap_s:.0f} ms"))
    assert gap_s < LONGEST_GAP_S
