"""Jobs as files, and pictures that are rendered only once, with a worker that only pretends to render."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import DeviceError, InputError
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.cycles_environment import create_environment, environment_python
from relit_studio.cycles.job import DistantLight, Mesh, PatchLight, Picture, Quality, Scene, Strands, write_job
from relit_studio.cycles.runner import render

FAKE = """
import json, pathlib, sys
job = json.loads(pathlib.Path(sys.argv[1]).read_text())
limit = int(pathlib.Path(sys.argv[0]).with_suffix(".limit").read_text())
print("Blender says something")
for number, picture in enumerate(job["pictures"]):
    if number == limit:
        print("Error: out of luck", file=sys.stderr)
        sys.exit(3)
    pathlib.Path(picture["path"]).write_text(json.dumps(picture["light"]))
    print(json.dumps({"picture": picture["path"], "seconds": 1.5}), flush=True)
"""


def scene() -> Scene:
    triangle = Mesh(
        "head",
        np.eye(3),
        np.array([[0, 1, 2, -1]]),
        np.array([0]),
        ("skin",),
        uv=np.zeros((3, 2)),
        attributes={"oil": np.ones(3)},
    )
    strands = Strands("hair", np.zeros((4, 3, 3)), np.ones((4, 3)), np.zeros(4), "hair")
    return Scene((triangle, strands), {"skin": {"kind": "plain", "colour": [1, 1, 1]}, "hair": {"kind": "hair"}})


def pictures(folder: Path, count: int) -> list[Picture]:
    return [Picture(folder / f"{index}.exr", DistantLight((0.0, 0.0, 1.0), irradiance=index)) for index in range(count)]


@pytest.fixture
def worker(tmp_path: Path) -> list[str]:
    program = tmp_path / "fake.py"
    program.write_text(FAKE)
    program.with_suffix(".limit").write_text("-1")
    return [sys.executable, str(program)]


def test_a_job_says_what_lights_each_picture(tmp_path: Path) -> None:
    lights = DistantLight((1.0, 0.0, 0.0)), PatchLight((1.0, 2.0, 60.0), (10.0, 8.0))
    listed = [Picture(tmp_path / f"{light.kind}.exr", light) for light in lights]
    job = json.loads(write_job(tmp_path / "job", scene(), Camera(64), Quality(), listed).read_text())
    assert job["pictures"][1]["light"] == {"center_cm": [1, 2, 60], "size_cm": [10, 8], "kind": "patch"}
    assert job["pictures"][0]["light"]["kind"] == "distant"


def test_a_job_says_everything(tmp_path: Path) -> None:
    moved = Picture(tmp_path / "a.exr", DistantLight((1.0, 0.0, 0.0)), {"head.vertices": np.ones((3, 3))})
    path = write_job(tmp_path / "job", scene(), Camera(64), Quality.truth(256, 1), [moved])
    job = json.loads(path.read_text())
    assert job["quality"] == {
        "samples": 256,
        "denoise": False,
        "clamp_indirect": 0.0,
        "seed": 0,
        "threads": 1,
        "pixel_filter": "BLACKMAN_HARRIS",
    }
    assert job["camera"]["focal_px"] == Camera(64).focal_px
    assert [each["name"] for each in job["scene"]["objects"]] == ["head", "hair"]
    assert job["pictures"][0]["light"]["direction"] == [1, 0, 0]
    arrays = np.load(path.parent / job["scene"]["arrays"])
    assert set(arrays) == {
        "head.vertices", "head.faces", "head.slots", "head.uv", "head.oil", "hair.points", "hair.radius", "hair.shade",
    }  # fmt: skip
    np.testing.assert_array_equal(np.load(path.parent / job["pictures"][0]["shape"])["head.vertices"], np.ones((3, 3)))


def test_only_what_is_missing_is_rendered(tmp_path: Path, worker: list[str]) -> None:
    wanted = pictures(tmp_path / "out", 5)
    Path(worker[1]).with_suffix(".limit").write_text("2")
    with pytest.raises(DeviceError, match="exit code 3: Error: out of luck"):
        render(scene(), Camera(64), Quality(), wanted, command=worker)
    assert [each.path.is_file() for each in wanted] == [True, True, False, False, False]
    wanted[0].path.write_text("kept")

    Path(worker[1]).with_suffix(".limit").write_text("-1")
    told: list[tuple[int, int]] = []
    seconds = render(
        scene(), Camera(64), Quality(), wanted, lambda done, total: told.append((done, total)), command=worker
    )
    assert told == [(2, 5), (3, 5), (4, 5), (5, 5)]
    assert seconds == {"2.exr": 1.5, "3.exr": 1.5, "4.exr": 1.5}
    assert wanted[0].path.read_text() == "kept"
    assert json.loads(wanted[4].path.read_text())["irradiance"] == 4
    assert render(scene(), Camera(64), Quality(), wanted, command=["/no/such/program"]) == {}


@pytest.mark.slow
def test_a_worker_that_does_not_end_is_ended(
    tmp_path: Path, worker: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with Path(worker[1]).open("a") as program:
        program.write("import os, signal\nos.close(1)\nsignal.pause()\n")
    monkeypatch.setattr("relit_studio.cycles.runner.WAIT_S", 1.0)
    assert list(render(scene(), Camera(64), Quality(), pictures(tmp_path / "out", 1), command=worker)) == ["0.exr"]


def test_a_worker_that_cannot_start_is_said(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="cannot start /no/such/program"):
        render(scene(), Camera(64), Quality(), pictures(tmp_path, 1), command=["/no/such/program"])


def test_without_cycles_the_cure_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(DeviceError, match="relit_studio setup"):
        environment_python()


def test_an_environment_that_cannot_be_made_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho ensurepip is not available\nexit 1\n")
    python.chmod(0o755)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("sys.executable", str(python))
    monkeypatch.setattr("shutil.which", lambda _: str(python))
    with pytest.raises(DeviceError, match="cannot make an environment: ensurepip is not available"):
        create_environment()


def test_a_folder_keeps_to_its_settings(tmp_path: Path) -> None:
    keep_settings(tmp_path / "new", "field.json", {"size": 64})
    keep_settings(tmp_path / "new", "field.json", {"size": 64})
    with pytest.raises(InputError, match="other settings"):
        keep_settings(tmp_path / "new", "field.json", {"size": 128})
    assert json.loads((tmp_path / "new" / "field.json").read_text()) == {"size": 64}
