"""Builders of subjects of films that a worker process can import, so this file imports little."""

from __future__ import annotations

import os
import threading
from pathlib import Path

from relit_camera.base.concurrency.worker_process import Progress
from relit_camera.base.errors import CaptureError
from relit_camera.live.status.film_status import FilmOptions, FilmReport
from relit_camera.subject.subject_file import write_subject
from tests.app.subject_builders import captured

FILM = b"a film" * 1000
KEPT = "kept"


def build_film(film: Path, name: str, options: FilmOptions, folder: Path, path: Path, tell: Progress) -> FilmReport:
    """A subject and a picture; the report says what it was given."""
    assert film.read_bytes() == FILM
    tell("Looking for flashes", 0, None)
    tell("Looking for flashes", 60, 120)
    tell("Building the field", 3, 4)
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    (pictures / "studio.jpg").write_bytes(b"a picture")
    write_subject(path, captured("film"))
    because = f"{name} at {options.light_distance_cm:g} cm"
    return FilmReport("good", because, 120, 0.5, 33.0, 900, 290, pictures=("studio",))


def refuse_film(film: Path, name: str, options: FilmOptions, folder: Path, path: Path, tell: Progress) -> FilmReport:
    """Refuse it, unless the lamp's distance is given."""
    if options.light_distance_cm == 80:
        return build_film(film, name, options, folder, path, tell)
    tell("Looking for flashes", 1, 2)
    raise CaptureError(f"no flash found in {film} and {folder}/kept", "let a light blink")


def keep_and_wait(film: Path, name: str, options: FilmOptions, folder: Path, path: Path, tell: Progress) -> FilmReport:
    """Keep something and wait; if something is kept, build."""
    kept = folder / f"subject.relit.partial-{options.size}"
    if kept.exists():
        return build_film(film, name, options, folder, path, tell)
    tell("Looking for flashes", 1, 1)
    kept.write_text("half of the work")
    path.write_bytes(b"half a subject")
    tell("Building the field", 1, 4)
    threading.Event().wait(120)
    raise AssertionError


def die_of_film(film: Path, name: str, options: FilmOptions, folder: Path, path: Path, tell: Progress) -> FilmReport:
    """End without a word, as a process does that the system ends."""
    os._exit(9)
