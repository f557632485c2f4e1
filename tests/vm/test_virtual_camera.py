"""The virtual camera on a real kernel: who finds it, what they see, and what they see when the camera is restarted."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest

from relit_camera.devices.sources.pattern_source import draw_pattern
from tests.vm.camera import SIZE, Camera, relit, running, without_models
from tests.vm.conftest import NEWEST
from tests.vm.guest.pattern_number import read_number
from tests.vm.machine import Machine, MachineError
from tests.vm.readers import FRAMES, NODE, READERS, Watcher, difference, finds_label

pytestmark = pytest.mark.timeout(900)

LARGER = (480, 270)
MOST_GAP_SHARE = 0.1
"""Of the time from `kill -9` until the new camera is live: both take the longer, the busier the host."""
MOST_GAP_S = 5.0
"""However busy it is: programs give a camera up after some ten seconds."""


def test_where_nobody_publishes_readers_find_no_camera(machine: Machine) -> None:
    raw = machine.host / "nobody.raw"
    stream = f"timeout 20 v4l2-ctl -d {NODE} --stream-mmap --stream-count=1 --stream-to=/host/{raw.name}"
    machine.run(stream, check=False)
    assert not raw.exists() or not raw.stat().st_size
    assert "Not a video capture device" in machine.run(f"ffmpeg -f v4l2 -i {NODE} -f null -", check=False).errors
    with pytest.raises(MachineError, match="OpenCV cannot open"):
        READERS["OpenCV"](machine)


@pytest.fixture(scope="class")
def camera(machine: Machine) -> Iterator[Camera]:
    """One camera for all tests that leave it as it is."""
    with running(machine) as camera:
        yield camera


class TestWhileItRuns:
    @pytest.mark.parametrize("reader", READERS)
    def test_a_reader_gets_the_right_pixels(
        self, camera: Camera, machine: Machine, saw: Callable[[str, str], None], reader: str
    ) -> None:
        seen = READERS[reader](machine)
        number = read_number(seen.image)
        assert number is not None
        worst = difference(seen.image, draw_pattern(SIZE, number))
        saw(reader, f"{seen.format}; {FRAMES} pictures, colours within {worst} of 255")
        assert worst <= 6

    @NEWEST
    def test_a_second_camera_is_refused(self, camera: Camera, machine: Machine) -> None:
        before = camera.status()["frames"]["published"]
        outcome = relit(machine, f"run --strict --source pattern --port 0 {without_models(machine)}")
        assert outcome.status == 1
        assert outcome.errors.splitlines()[-1] == (
            f"relit: another Relit Camera publishes to {NODE} already; "
            "stop that one (relit doctor names its process), or give this one a name of its own: output.label"
        )
        assert camera.status()["frames"]["published"] > before

    @NEWEST
    def test_it_never_films_itself(self, camera: Camera, machine: Machine) -> None:
        outcome = relit(machine, f"run --strict --source {NODE} --port 0 {without_models(machine)}")
        assert outcome.status == 1
        assert outcome.errors.splitlines()[-1] == (
            f"relit: '{NODE}' is our own virtual camera: it would film itself; choose another source"
        )

    def test_it_is_listed_by_its_label(self, camera: Camera, machine: Machine) -> None:
        assert finds_label(machine) == {"v4l2-ctl": True, "ffmpeg": True}
        listed = json.loads(relit(machine, "devices --json").output)["virtual_cameras"]
        assert listed == [{"label": "Relit Camera", "node": NODE, "ours": True, "size": list(SIZE)}]

    def test_a_reader_stays_through_kill_stop_and_another_size(
        self, camera: Camera, machine: Machine, version: str, saw: Callable[[str, str], None]
    ) -> None:
        """Last of those of this camera, which it kills."""
        with Watcher(machine, "generations") as watcher:
            before = watcher.wait_for(30)
            saw("OpenCV, while the camera runs", f"longest gap {longest_gap_s(before):.2f} s")
            killed = len(watcher.rows())
            camera.kill()
            watcher.wait_for(50, after=killed)
            away = watcher.rows()[killed - 1 :]
            saw("OpenCV, after `kill -9`", f"longest gap {longest_gap_s(away):.2f} s")
            with running(machine) as second:
                live = len(watcher.rows())
                again = watcher.wait_for(5, after=live + 2)  # buffers may still hold pictures of before
                assert second.stop().status == 0
            stopped = len(watcher.rows())
            with running(machine, size=LARGER):
                other = watcher.wait_for(5, after=stopped + 2)
                image = watcher.stop()
        rows = watcher.rows()
        assert all(row["size"] == list(SIZE) for row in rows), "the size must stay while somebody reads"
        for generation in (rows[:killed], again, other):
            numbers = [row["number"] for row in generation]
            assert None not in numbers[-5:]
            assert numbers[-1] > numbers[-5]
        number = read_number(image)
        assert number is not None
        assert difference(image, draw_pattern(SIZE, number)) <= 6
        nobody = rows[killed - 1 : live + 1]
        saw("OpenCV, until the new camera is live", f"longest gap {longest_gap_s(nobody):.2f} s")
        assert longest_gap_s(nobody) < min(MOST_GAP_SHARE * (nobody[-1]["at"] - nobody[0]["at"]), MOST_GAP_S)
        gap_s = rows[stopped]["at"] - rows[stopped - 1]["at"]
        saw("OpenCV, reading on", f"stop and start with another size: goes on after {gap_s:.0f} s")


def longest_gap_s(rows: list[dict[str, Any]]) -> float:
    """Between two pictures that follow each other."""
    return max(later["at"] - earlier["at"] for earlier, later in pairwise(rows))
