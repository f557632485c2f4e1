"""Runs a job in Cycles' environment. A repeated run renders only the pictures that are missing."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import relit_studio
from relit_camera.base.errors import DeviceError
from relit_camera.base.storage.atomic_files import make_folder
from relit_studio.base.progress import Progress, no_progress
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.cycles_environment import environment_python
from relit_studio.cycles.job import Picture, Quality, Scene, write_job

WAIT_S = 10.0
"""How long a worker that says no more, or that was told to end, may take to end."""


def render(
    scene: Scene,
    camera: Camera,
    quality: Quality,
    pictures: Sequence[Picture],
    progress: Progress = no_progress,
    command: Sequence[str] | None = None,
) -> dict[str, float]:
    """Render the pictures that do not exist yet; returns the seconds of each by name.

    Args:
        scene: as it is when no shape is given.
        camera: the same for all.
        quality: the same for all.
        pictures: in the order they shall be made in.
        progress: told of pictures that were there before, too.
        command: that runs a worker, given the job file; Cycles' own unless given.

    Raises:
        DeviceError: Cycles is not set up, or fails.
        StorageError: a folder cannot be written.
    """
    for picture in pictures:
        make_folder(picture.path.parent)
    missing = [picture for picture in pictures if not picture.path.is_file()]
    done = len(pictures) - len(missing)
    progress(done, len(pictures))
    seconds: dict[str, float] = {}
    if not missing:
        return seconds
    command = command or [str(environment_python()), "-m", "relit_studio.cycles.worker"]
    with tempfile.TemporaryDirectory(prefix="relit-studio.") as folder:
        job = write_job(Path(folder), scene, camera, quality, missing)
        for report in _reports([*command, str(job)], Path(folder) / "stderr.txt"):
            seconds[Path(report["picture"]).name] = float(report["seconds"])
            done += 1
            progress(done, len(pictures))
    absent = next((picture.path for picture in missing if not picture.path.is_file()), None)
    if absent is not None:
        raise DeviceError(f"Cycles ended without {absent.name}", "run the command again: it goes on where it stopped")
    return seconds


def _reports(command: Sequence[str], errors: Path) -> Iterator[dict[str, str]]:
    with errors.open("w+", encoding="utf-8") as stderr, _process(command, stderr.fileno()) as process:
        assert process.stdout is not None
        for line in process.stdout:
            # Blender writes messages to stdout, too.
            if line.startswith('{"picture"'):
                yield json.loads(line)
        try:
            failed = process.wait(WAIT_S)
        except subprocess.TimeoutExpired:
            return  # No more output. `render` checks whether pictures are missing.
        if failed:
            stderr.seek(0)
            last = (stderr.read().strip().splitlines() or ["no message"])[-1]
            raise DeviceError(f"Cycles failed with exit code {process.returncode}: {last}", "see what it says")


@contextmanager
def _process(command: Sequence[str], stderr: int) -> Iterator[subprocess.Popen[str]]:
    """The worker process, terminated when the context ends."""
    environment = os.environ | {"PYTHONPATH": str(Path(relit_studio.__path__[0]).parent)}
    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True, env=environment)
    except OSError as error:
        raise DeviceError(f"cannot start {command[0]}: {error.strerror}", "set Cycles up again") from error
    assert process.stdout is not None
    try:
        yield process
    finally:
        process.stdout.close()
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(WAIT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait(WAIT_S)
