"""How much work it is until somebody is a subject and is seen relit: processor time, as others may use the machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from relit_camera.app.demo import demo_files
from relit_camera.base.errors import InputError
from relit_camera.lab.bench.mesh_run import MeshRun
from relit_camera.subject.subject_file import read_metadata
from tests.capture.desk.bundled_person import film_bundled_person
from tests.capture.instant.conftest import models, pulled_models
from tests.capture_times import Taken, capture, first_relit_picture
from tests.cli.relit_command import call

__all__ = ["models", "pulled_models"]

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("models")]

INSTANT_RUNS, DESK_RUNS, FIRST_PICTURE_RUNS = 1030, 4500, 1500
"""Processor time in mesh runs of what is done here: means of two measurements on two busy cores, 26 November 2026."""
MOST = 2.0
"""Times that. Less tells nothing on a machine that others use too."""


def mesh_runs(measure: Callable[[], Taken]) -> float:
    """Processor time of something, in mesh runs before and after it."""
    mesh = MeshRun()
    mesh.sample()
    taken = measure()
    mesh.sample()
    return 1e3 * taken.processor_s / mesh.ms


@pytest.mark.study
def test_an_instant_subject_is_made_of_a_clip(tmp_path: Path) -> None:
    assert mesh_runs(lambda: capture("instant", demo_files.CLIP, folder=tmp_path)) < MOST * INSTANT_RUNS
    assert read_metadata(tmp_path / "me.relit").rung == "instant"


@pytest.mark.study
def test_a_desk_recording_becomes_a_subject(tmp_path: Path) -> None:
    frames = film_bundled_person(tmp_path / "frames", 5, 2)
    assert mesh_runs(lambda: capture("desk", "--frames", frames, folder=tmp_path)) < MOST * DESK_RUNS
    metadata = read_metadata(tmp_path / "me.relit")
    assert (metadata.rung, metadata.lights) == ("desk", 15)


@pytest.mark.study
def test_somebody_who_begins_sees_themselves_relit(tmp_path: Path) -> None:
    assert mesh_runs(lambda: first_relit_picture(tmp_path)) < MOST * FIRST_PICTURE_RUNS


@pytest.mark.parametrize(
    ("words", "work"),
    [
        (("instant", demo_files.CLIP), "relit_camera.capture.instant.instant_capture.capture_instant"),
        (("desk", "--frames", "."), "relit_camera.capture.desk.desk_capture.build_desk_subject"),
    ],
)
def test_blas_has_one_thread_while_a_subject_is_made(words: tuple[object, ...], work: str, tmp_path: Path) -> None:
    """More would spin while they wait: twice the processor time, for the same result."""
    seen: list[int] = []

    def begun(*_: object) -> None:
        seen.extend(library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas")
        raise InputError("enough is seen", "none")

    with (
        threadpool_limits(limits=2, user_api="blas"),
        patch(work, begun),
        patch("relit_camera.capture.desk.desk_recording.read_desk_recording"),
    ):
        call("capture", *words, "--out", tmp_path / "me.relit").complains("enough is seen")
    assert set(seen) == {1}
