"""`relit capture expressions`: stills from a film, and one clear line where a film gives none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.models.model_store import FOLDER_VARIABLE
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.capture.instant.instant_capture import build_instant_subject
from relit_camera.subject.subject_file import read_subject, write_subject
from tests.capture.instant.conftest import models, pulled_models
from tests.cli.relit_command import call

__all__ = ["models", "pulled_models"]


def film(path: Path, pictures: list[np.ndarray]) -> Path:
    """A film of some pictures at 24 a second."""
    height, width = pictures[0].shape[:2]
    with VideoWriter(path, (width, height), 24.0) as writer:
        for index, picture in enumerate(pictures):
            writer.write(picture, index / 24)
    return path


@pytest.fixture(scope="module")
def talk(shared: Path) -> Path:
    return shared / "driving" / "adam_talk.mp4"


@pytest.fixture(scope="module")
def talking(talk: Path) -> list[np.ndarray]:
    with VideoReader(talk) as frames:
        return [frame.image for frame in frames]


@pytest.fixture(scope="module")
def made_subject(tmp_path_factory: pytest.TempPathFactory, talking: list[np.ndarray], pulled_models: Path) -> Path:
    path = tmp_path_factory.mktemp("subject") / "me.relit"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(pulled_models))
        write_subject(path, build_instant_subject(talking[:4], "talk"))
    return path


@pytest.fixture
def subject(made_subject: Path, models: Path) -> Path:
    """Read by the tests, and written by none."""
    return made_subject


@pytest.mark.slow
def test_a_film_of_the_person_adds_stills_and_says_what_they_show(tmp_path: Path, subject: Path, talk: Path) -> None:
    out = tmp_path / "with.relit"
    answer = call("capture", "expressions", talk, "--subject", subject, "--out", out)
    assert answer.code == 0, answer
    for words in ("with.relit: ", " stills: ", "lips apart", "turned left", "turned right", "eyes shut"):
        assert words in answer.out
    assert "open your mouth wide" in answer.err
    before, after = read_subject(subject), read_subject(out)
    assert not before.stills
    assert len(after.stills) >= 6
    np.testing.assert_array_equal(after.neutral, before.neutral)
    assert out.stat().st_size - subject.stat().st_size < 6 << 20


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda pictures: [np.full_like(picture, 90) for picture in pictures[:30]], ["no face was found"]),
        (lambda pictures: pictures[:10], ["10 of the 10 frames", "at least 24"]),
        (lambda pictures: pictures[:1] * 30, ["does too little", "open your mouth wide"]),
        (lambda pictures: [picture // 12 for picture in pictures[:30]], ["dark"]),
    ],
)
def test_a_film_that_gives_none_is_refused_and_nothing_is_written(
    tmp_path: Path,
    subject: Path,
    talking: list[np.ndarray],
    change: Callable[[list[np.ndarray]], list[np.ndarray]],
    words: list[str],
) -> None:
    path = film(tmp_path / "bad.mp4", change(talking))
    out = tmp_path / "with.relit"
    call("capture", "expressions", path, "--subject", subject, "--out", out).complains("bad.mp4", *words)
    assert not out.exists()


@pytest.mark.slow
def test_another_person_is_refused(tmp_path: Path, subject: Path, shared: Path) -> None:
    other = shared / "driving" / "liveportrait_d9.mp4"
    call("capture", "expressions", other, "--subject", subject, "--out", tmp_path / "with.relit").complains(
        "is not the subject's"
    )


def test_a_subject_that_is_not_there_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.mp4").write_bytes(b"no film")
    call("capture", "expressions", tmp_path / "a.mp4", "--subject", tmp_path / "no.relit").complains("no.relit")
