"""Calling `relit`: as a process of its own where that matters, else in this one, which is much faster."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import partial
from io import StringIO
from pathlib import Path
from unittest.mock import patch

import numpy as np

from relit_camera.base.images.image_types import Frame
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.cli.main import run
from relit_camera.face.tracking.track_recording import TrackRecorder
from relit_camera.lab.bench.synthetic_tracker import SyntheticTracker
from relit_camera.subject.subject_file import write_subject
from tests.generated_subject import small_subject

_PROGRAM = "import sys; sys.argv[0] = 'relit'; from relit_camera.cli.main import run; run()"
COMMAND = [sys.executable, "-c", _PROGRAM]
CLIP_SIZE, CLIP_FPS = (128, 96), 20.0


@dataclass(frozen=True)
class Answer:
    """How a command ended."""

    code: int
    out: str
    err: str

    def complains(self, *words: str, code: int = 1) -> None:
        """It ended with one line on stderr that says all the words, and with no traceback.

        Raises:
            AssertionError: otherwise.
        """
        assert self.code == code, self
        lines = self.err.splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("relit: "), lines[0]
        assert ";" in lines[0], f"no cure: {lines[0]}"
        for word in words:
            assert word in lines[0], f"{word!r} is not in: {lines[0]}"


def call(*arguments: object) -> Answer:
    """Run a command in this process, as its entry point does. A fault of ours is raised, not printed."""
    out, err = StringIO(), StringIO()
    code = 0
    with patch.object(sys, "argv", ["relit", *map(str, arguments)]), redirect_stdout(out), redirect_stderr(err):
        try:
            run()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    return Answer(code, out.getvalue(), err.getvalue())


def start(
    *arguments: object, folder: Path, full_at: int | None = None, check_period_s: float | None = None
) -> subprocess.Popen[str]:
    """Start a command in a process of its own, which keeps its data in `folder`.

    With `full_at` no file may grow beyond so many bytes: the kernel refuses to write them, as on a full disk. With
    `check_period_s` files are looked at each so many seconds.
    """
    program = _PROGRAM
    if check_period_s is not None:
        program = (
            f"from relit_camera.base.concurrency import regular_checks as r; r.PERIOD_S = {check_period_s}; {program}"
        )
    limit = None if full_at is None else partial(resource.setrlimit, resource.RLIMIT_FSIZE, (full_at, full_at))
    variables = environment(folder)
    if limit is not None:
        # Coverage, where it is measured, could not write its file either, and would say so.
        variables = {name: value for name, value in variables.items() if not name.startswith("COVERAGE_")}
    return subprocess.Popen(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=variables,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=limit,
    )


def finish(*arguments: object, folder: Path, timeout_s: float = 60) -> Answer:
    """Run a command in a process of its own to its end."""
    done = subprocess.run(
        [*COMMAND, *map(str, arguments)],
        env=environment(folder), capture_output=True, text=True, timeout=timeout_s, check=False,
    )  # fmt: skip
    return Answer(done.returncode, done.stdout, done.stderr)


def environment(folder: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("RELIT_")}
    models = {name: value for name, value in os.environ.items() if name == "RELIT_MODELS_DIR"}
    return {**kept, **models, "RELIT_STORAGE__DATA_DIR": str(folder / "data")}


def files(folder: Path) -> set[str]:
    """Every file and folder below, hidden ones too."""
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@dataclass(frozen=True)
class Material:
    """A subject file, a clip of grey frames, and a track of a face that nods in it."""

    subject: Path
    clip: Path
    track: Path

    @property
    def tracker(self) -> str:
        """The tracker that plays the track."""
        return f"recorded:{self.track}"


def write_material(folder: Path, frames: int = 40) -> Material:
    """Write what a replay or a run needs, without any model."""
    material = Material(folder / "small.relit", folder / "clip.mp4", folder / "track.json")
    write_subject(material.subject, small_subject())
    recorder = TrackRecorder(SyntheticTracker(), CLIP_SIZE, CLIP_FPS)
    with VideoWriter(material.clip, CLIP_SIZE, CLIP_FPS) as video:
        for index in range(frames):
            picture = np.full((CLIP_SIZE[1], CLIP_SIZE[0], 3), 90 + index % 20, np.uint8)
            video.write(picture)
            time_s = index / CLIP_FPS
            recorder.add(SyntheticTracker().track(Frame(picture, index, 0.0, time_s)), time_s)
    recorder.write(material.track)
    return material
