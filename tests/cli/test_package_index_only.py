"""A machine that reaches only a package index: from nothing to a tracked, relit and cut-out person."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.app.demo import demo_files
from relit_camera.base.images.image_files import read_display
from relit_camera.base.images.resize import halve
from relit_camera.base.models.model_store import ModelStore
from relit_camera.base.models.session_with_fallback import open_session
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.mesh_refinement import mesh_points
from relit_camera.face.tracking.track_recording import read_track
from tests.cli.relit_command import COMMAND, Answer
from tests.package_index import require_package_index

pytestmark = pytest.mark.slow

FRAMES = 24
HOSTS = ("storage.googleapis.com", "github.com", "cdn.jsdelivr.net", "registry.npmjs.org")
NO_HOSTS = f"""
import socket
ask = socket.getaddrinfo
def refuse(host, *rest, **more):
    if host in {HOSTS}:
        raise socket.gaierror(-2, "refused by the test")
    return ask(host, *rest, **more)
socket.getaddrinfo = refuse
"""
REFERENCE = Path(__file__).parent / "mesh_reference"
PIP_SETTINGS = (".config/pip/pip.conf", ".pip/pip.conf")
"""Of a user, from the home."""
BACKGROUND = (48, 80, 112)
INDEXED = {"face_mesh_attention", "face_detector_short_range", "selfie_landscape", "selfie_square"}


@dataclass(frozen=True)
class Machine:
    """Reaches no host of the models' authors; the home is empty at first."""

    folder: Path

    def relit(self, *arguments: object) -> Answer:
        """Run a command."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("RELIT_", "XDG_"))}
        # With a proxy the names would be looked up there.
        direct = dict.fromkeys(("NO_PROXY", "no_proxy"), ",".join((*HOSTS, os.environ.get("NO_PROXY", ""))))
        own = {"HOME": str(self.home), "PYTHONPATH": str(self.folder / "python")}
        # Which index it is may be in the settings of the real home.
        settings = [path for place in PIP_SETTINGS if (path := Path.home() / place).exists()]
        if settings:
            own["PIP_CONFIG_FILE"] = str(settings[0])
        everything = {**kept, **direct, **own}
        command = [*COMMAND, *map(str, arguments)]
        done = subprocess.run(command, env=everything, capture_output=True, text=True, timeout=120, check=False)
        return Answer(done.returncode, done.stdout, done.stderr)

    @property
    def home(self) -> Path:
        return self.folder / "home"

    @property
    def models(self) -> Path:
        return self.home / ".cache" / "relit-camera" / "models"


@pytest.fixture(scope="module")
def pulled(tmp_path_factory: pytest.TempPathFactory) -> tuple[Machine, Answer]:
    """The machine after `relit models pull`, and what that said."""
    require_package_index()
    folder = tmp_path_factory.mktemp("index only")
    (folder / "python").mkdir()
    (folder / "home").mkdir()
    (folder / "python" / "sitecustomize.py").write_text(NO_HOSTS)
    machine = Machine(folder)
    return machine, machine.relit("models", "pull")


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first second of the demonstration's clip, at half its size."""
    path = tmp_path_factory.mktemp("clip") / "clip.mkv"
    with VideoReader(demo_files.CLIP) as reader, VideoWriter(
        path, (reader.info.width // 2, reader.info.height // 2), reader.info.fps
    ) as writer:  # fmt: skip
        for frame in islice(reader, FRAMES):
            writer.write(halve(frame.image))
    return path


def landmarks(track: Path) -> NDArray[np.float32]:
    """The landmarks (FRAMES, 478, 2) in a recorded track."""
    return np.array([frame.landmarks for frame in read_track(track).frames[:FRAMES]], np.float32)


def test_a_pull_ends_with_all_that_is_needed(pulled: tuple[Machine, Answer]) -> None:
    machine, answer = pulled
    assert answer.code == 0, answer
    assert "no connection to storage.googleapis.com" in answer.out
    assert "face_mesh_attention stands in for it" in answer.out
    store = ModelStore(machine.models)
    assert {name for name in store.names() if store.is_pulled(name)} == INDEXED
    lines = machine.relit("models", "list").out.splitlines()
    assert sum("index: mediapipe 0.10.14" in line for line in lines) == len(INDEXED)


def test_the_mesh_is_what_mediapipe_computes(pulled: tuple[Machine, Answer]) -> None:
    mesh = open_session(ModelStore(pulled[0].models).path("face_mesh_attention"), "face_mesh_attention")
    crop = read_display(REFERENCE / "crop.png").astype(np.float32) / 255
    expected = np.loadtxt(REFERENCE / "landmarks.csv", delimiter=",")
    np.testing.assert_allclose(mesh_points(mesh.run({"image": crop[None]})), expected, atol=2e-3)


def test_the_face_is_tracked(pulled: tuple[Machine, Answer], clip: Path, tmp_path: Path) -> None:
    answer = pulled[0].relit("track", clip, "--out", tmp_path / "track.json")
    assert answer.code == 0, answer
    assert "face found in 100 %" in answer.out
    scheme = landmark_scheme("mesh478")
    found, expected = landmarks(tmp_path / "track.json"), landmarks(demo_files.TRACK) / 2
    offsets = np.linalg.norm(found - expected, axis=2).mean(axis=1) / [scheme.eye_span(face) for face in expected]
    assert np.median(offsets) < 0.04


def test_the_person_is_relit_before_another_background(
    pulled: tuple[Machine, Answer], clip: Path, tmp_path: Path
) -> None:
    out, report = tmp_path / "relit.mkv", tmp_path / "report.json"
    color = "#{:02x}{:02x}{:02x}".format(*BACKGROUND)
    answer = pulled[0].relit(
        "replay", clip, "--subject", demo_files.SUBJECT, "--environment", "sunset", "--mode", "live",
        "--background", color, "--out", out, "--report", report,
    )  # fmt: skip
    assert answer.code == 0, answer
    assert f"face found in {FRAMES}" in answer.out
    assert json.loads(report.read_text())["degraded"] == []
    with VideoReader(clip) as before, VideoReader(out) as after:
        live, relit = (list(reader)[-1].image.astype(float) for reader in (before, after))
    points = landmarks(demo_files.TRACK)[-1] / 2
    left, top, right, bottom = (int(value) for value in (*points.min(axis=0), *points.max(axis=0)))
    corner = relit[:40, :40].mean((0, 1))
    np.testing.assert_allclose(corner, BACKGROUND, atol=6)
    face = np.s_[top + 10 : bottom - 10, left + 10 : right - 10]
    warmth = [image[face][..., 0].mean() / image[face][..., 2].mean() for image in (live, relit)]
    assert warmth[1] > 1.3 * warmth[0]  # a sunset is redder than the room


def test_a_recorded_video_is_relit_without_a_subject(
    pulled: tuple[Machine, Answer], clip: Path, tmp_path: Path
) -> None:
    out = tmp_path / "relit.mp4"
    answer = pulled[0].relit("replay", clip, "--instant", "--environment", "sunset", "--out", out)
    assert answer.code == 0, answer
    assert f"{out}: {FRAMES} frames, face found in {FRAMES}" in answer.out
