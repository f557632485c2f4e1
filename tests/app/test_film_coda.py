"""Expression stills from the end of a capture film: added where it shows them, told why where it does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from relit_camera.app.captures.film.film_coda import STAGE, with_coda_stills
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.instant.instant_capture import build_instant_subject
from tests.app.subject_builders import captured
from tests.capture.instant.conftest import models, pulled_models

__all__ = ["models", "pulled_models"]


def ignore(stage: str, done: int, total: int | None) -> None:
    """Hear how far it is."""


def test_a_film_that_ends_with_the_flashes_is_not_looked_at(tmp_path: Path) -> None:
    subject = captured("film")
    assert with_coda_stills(tmp_path / "no.mp4", "me.mov", {"coda": None}, subject, ignore) == (subject, "")
    assert with_coda_stills(tmp_path / "no.mp4", "me.mov", {}, subject, ignore) == (subject, "")


def test_an_end_that_gives_none_leaves_the_subject_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "none"))
    subject = captured("film")
    same, told = with_coda_stills(tmp_path / "no.mp4", "me.mov", {"coda": 100}, subject, ignore)
    assert same is subject
    assert told.startswith("the film's end, after the flashes, gives no expression stills: ")
    assert "relit models pull" in told


@pytest.mark.slow
def test_an_end_in_which_somebody_talks_gives_stills(shared: Path, models: Path) -> None:
    talk = shared / "driving" / "adam_talk.mp4"
    with VideoReader(talk) as reader:
        frames = [frame.image for frame in reader]
    stages: set[str] = set()
    subject = build_instant_subject(frames[:4], "talk")
    with_stills, told = with_coda_stills(
        talk, "me.mov", {"coda": 8}, subject, lambda stage, done, total: stages.add(stage)
    )
    assert len(with_stills.stills) >= 4
    assert told.startswith(f"{len(with_stills.stills)} expression stills were taken")
    assert stages == {STAGE}
