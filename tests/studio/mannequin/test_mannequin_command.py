"""`python -m relit_studio.mannequin`: what it leaves on the disk."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from relit_camera.capture.picture_import import import_samples
from relit_studio.mannequin.__main__ import main

pytestmark = pytest.mark.slow

ARGUMENTS = ["--size", "96", "--lights", "12", "--frames", "3"]


def digests(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def test_one_light_pictures_import(generated: Path) -> None:
    samples = import_samples(generated / "olat" / "lights.lp")
    assert samples.pictures.shape == (12, 96, 96, 3)
    assert (samples.pictures[:, samples.matte == 0] == 0).all()
    assert samples.pictures.max() <= 1
    lit_right = samples.directions[:, 0] > 0.5
    sums = samples.pictures.sum(axis=(1, 3))
    assert (sums[lit_right][:, 48:].sum(axis=1) > sums[lit_right][:, :48].sum(axis=1)).all()


def test_landmarks_and_geometry_lie_beside_them(generated: Path) -> None:
    points = np.array(json.loads((generated / "olat" / "landmarks.json").read_text())["mesh478"])
    assert points.shape == (478, 2)
    assert ((points > 15) & (points < 81)).all()
    truth = np.load(generated / "olat" / "truth.npz")
    inside = import_samples(generated / "olat" / "lights.lp").matte > 0.99
    np.testing.assert_allclose(np.linalg.norm(truth["normals"], axis=2)[inside], 1, atol=1e-4)
    assert truth["albedo"].shape == (96, 96, 3)
    # The nose tip's landmark is where the depth picture is nearest.
    nearest = np.unravel_index(truth["depth"].argmax(), (96, 96))[::-1]
    assert np.linalg.norm(np.array(nearest) + 0.5 - points[4]) < 2.5


def test_a_second_run_in_another_process_writes_the_same_bytes(generated: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "relit_studio.mannequin", "--out", str(tmp_path / "again"), *ARGUMENTS]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "one-light pictures" in done.stderr
    assert digests(tmp_path / "again") == digests(generated)


def test_output_replaces_its_own_names_only(generated: Path, tmp_path: Path) -> None:
    (tmp_path / "olat").mkdir()
    (tmp_path / "olat" / "old.png").touch()
    (tmp_path / "notes.txt").write_text("mine")
    arguments = ["--out", str(tmp_path), "--size", "32", "--lights", "4", "--frames", "1", "--quiet"]
    assert main(arguments) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [*(path.name for path in generated.iterdir()), "notes.txt"]
    )
    assert not (tmp_path / "olat" / "old.png").exists()


def test_a_file_in_the_way_is_one_clear_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "file"
    target.write_text("not a folder")
    assert main(["--out", str(target), "--quiet"]) == 1
    assert str(target) in capsys.readouterr().err
    assert target.read_text() == "not a folder"


@pytest.mark.parametrize("wrong", [["--size", "8"], ["--lights", "three"], ["--frames", "0"], []])
def test_usage_errors_exit_with_two(wrong: list[str], tmp_path: Path) -> None:
    arguments = [*(["--out", str(tmp_path / "x")] if wrong else []), *wrong]
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    assert not (tmp_path / "x").exists()
