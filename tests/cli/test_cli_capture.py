"""`relit capture build` of a good film: what its options do, and that it goes on where it was broken off."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors import safe_open

from relit_camera.base.errors import CaptureError
from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
from relit_camera.capture.film.pipeline.checkpoint import (
    SAMPLES_FILE_NAME,
    Checkpoint,
    CheckpointFolder,
    input_fingerprint,
)
from relit_camera.subject.subject_file import HEADER_KEY, read_subject
from tests.capture.film.generated_film import FOCAL_PX, write_film
from tests.capture.film.pipeline import unusable_films as films
from tests.cli.relit_command import Answer, call, files, finish, start
from tests.small_camera import wait_until
from tests.synthetic import sphere_samples

PATIENCE_S = 100
CHOSEN: dict[str, object] = {"size": 72, "light-distance-cm": 90}
KNOWN = [*films.Shot(np.empty((0, 1, 1, 3), np.uint8), CHOSEN).arguments, "--keep-room", "--far-lamp"]


@dataclass(frozen=True)
class Built:
    """A film, the folder with what was made of it, and how that ended."""

    film: Path
    folder: Path
    answer: Answer


@pytest.fixture(scope="module", autouse=True)
def no_detector(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The head of this film is none that a detector knows."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RELIT_MODELS_DIR", str(tmp_path_factory.mktemp("models")))
        yield


def command(film: Path, folder: Path, *options: object) -> list[object]:
    """Into me.relit and me.json of a folder."""
    return ["capture", "build", film, "--out", folder / "me.relit", "--report", folder / "me.json", *options]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    film, folder = tmp_path_factory.mktemp("film") / "film.mp4", tmp_path_factory.mktemp("built")
    shutil.copyfile(films.good_film(), film)
    return Built(film, folder, call(*command(film, folder, *KNOWN)))


def report(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "me.json").read_text()))


def content(subject: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Header, without the time, and the bytes of every tensor."""
    with safe_open(subject, framework="numpy") as file:
        header = json.loads(file.metadata()[HEADER_KEY])
        del header["created_at"]
        return header, {name: file.get_tensor(name).tobytes() for name in file.keys()}  # noqa: SIM118


@pytest.mark.slow
def test_options_are_followed_and_told(built: Built) -> None:
    assert built.answer.code == 0, built.answer
    told, subject = report(built.folder), read_subject(built.folder / "me.relit").metadata
    assert told["square"]["size"] == subject.width == subject.height == 72
    assert told["room"]["taken_off"] is False
    assert told["near_field"]["corrected"] is False
    assert told["near_field"]["light_distance_cm"] == 90
    assert (told["focal_px"], told["focal"]["source"]) == (FOCAL_PX, "given")
    assert told["face"]["found_by"] == "user"
    assert told["light"]["lights"] == subject.lights
    assert told["light"]["frames"] == sum(frame["kind"] == "bright" for frame in told["frames"])
    assert (subject.method, subject.gamma, subject.source) == ("blend", str(films.GAMMA), "film.mp4")
    assert f"72x72, {subject.lights} lights of {told['light']['frames']} flashes' frames" in built.answer.out
    assert built.answer.err.splitlines() == [f"warning: {warning}" for warning in told["warnings"]]
    assert files(built.folder) == {"me.relit", "me.json"}


@pytest.mark.study
def test_a_build_that_is_killed_goes_on_to_the_same_subject(built: Built, tmp_path: Path) -> None:
    process = start(*command(built.film, tmp_path, *KNOWN), folder=built.film.parent)
    samples = tmp_path / "me.relit.partial" / SAMPLES_FILE_NAME
    wait_until(lambda: samples.exists() or process.poll() is not None, PATIENCE_S)
    assert process.poll() is None, process.communicate()
    process.kill()
    process.communicate()
    assert not (tmp_path / "me.relit").exists()
    resumed = finish(*command(built.film, tmp_path, *KNOWN), folder=built.film.parent, timeout_s=PATIENCE_S)
    assert resumed.code == 0, resumed
    first, *rest = resumed.err.splitlines()
    assert first == f"going on from {tmp_path / 'me.relit.partial'}, where the last build was broken off"
    assert rest == built.answer.err.splitlines()
    assert content(tmp_path / "me.relit") == content(built.folder / "me.relit")
    assert report(tmp_path) == report(built.folder)
    assert not (tmp_path / "me.relit.partial").exists()


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A film, and a checkpoint of it beside; whoever reads the film again finds no flash."""

    def refuse(*_: object) -> None:
        raise CaptureError("no flash found", "let a light blink")

    monkeypatch.setattr("relit_camera.capture.film.pipeline.film_subject.build_samples", refuse)
    film = write_film(tmp_path / "film.mp4", np.zeros((12, 64, 64, 3), np.uint8))
    folder = CheckpointFolder(tmp_path / "me.relit", input_fingerprint(film, CaptureOptions()), print)
    folder.write(Checkpoint(sphere_samples(40, 24), {"warnings": ["a guess"], "light": {"frames": 77}}))
    return film


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--method", "barycentric")])
def test_the_film_is_not_read_again(options: tuple[str, ...], kept: Path) -> None:
    """Nor for another method: what the film gave does not depend on it."""
    answer = call(*command(kept, kept.parent, *options))
    assert answer.code == 0, answer
    assert "24x24, 40 lights of 77 flashes' frames" in answer.out
    assert answer.err.splitlines()[1:] == ["warning: a guess"]
    assert report(kept.parent)["light"] == {"frames": 77}
    assert files(kept.parent) == {"film.mp4", "me.relit", "me.json"}


@pytest.mark.parametrize(("option", "told"), [("--fresh", []), ("--far-lamp", ["other options"])])
def test_it_starts_over_and_a_refusal_leaves_nothing(option: str, told: list[str], kept: Path) -> None:
    answer = call(*command(kept, kept.parent, option))
    assert answer.code == 1
    *lines, last = answer.err.splitlines()
    assert last == "relit: no flash found; let a light blink"
    assert len(lines) == len(told)
    assert all(words in line for words, line in zip(told, lines, strict=True))
    assert files(kept.parent) == {"film.mp4"}


def test_a_film_that_is_not_there_costs_nothing_that_was_kept(kept: Path) -> None:
    call(*command(kept.parent / "fim.mp4", kept.parent)).complains("no video at", "check the path")
    assert files(kept.parent) == {"film.mp4", "me.relit.partial", f"me.relit.partial/{SAMPLES_FILE_NAME}"}
