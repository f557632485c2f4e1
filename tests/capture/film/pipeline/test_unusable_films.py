"""Bad films, by the command line: each is refused with what is wrong and what to do, and nothing is written."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.capture.film.generated_film import write_film
from tests.capture.film.pipeline import unusable_films as films
from tests.capture.film.pipeline.unusable_films import Shot
from tests.cli.relit_command import Answer, call

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def good() -> np.ndarray:
    return films.GOOD.codes()


@pytest.fixture(autouse=True)
def no_detector(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """The head of these films is none that a detector knows."""
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path_factory.mktemp("models")))


def contents(folder: Path) -> dict[str, bytes | None]:
    """Every file below with its bytes, and every folder."""
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    """A folder with a subject of an earlier capture, which stays as it is, alone."""
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "me.relit").write_bytes(b"precious")
    yield folder
    assert contents(folder) == {"me.relit": b"precious"}


def build(film: Path, shot: Shot, folder: Path) -> Answer:
    into = ("--out", folder / "me.relit", "--report", folder / "me.json")
    return call("capture", "build", film, *into, *shot.arguments, "--threads", 1)


@pytest.mark.parametrize(
    ("spoil", "what", "cure"),
    [
        (films.lamp_off, "no flash found: the brightness stays within", "let a light blink"),
        (films.lamp_on_all_the_time, "no flash found: the brightness changes by a factor", "must not be on all the"),
        (films.too_short, "flashes found", "half a minute or more"),
        (films.mostly_weak, "frames wholly and strongly enough", "about a metre away and pointing at the face"),
        (films.too_fast, "too fast for 30 frames a second", "let it blink at most 5 times a second"),
        (films.no_ball, "no mirror ball was found", "put a shiny ball of at least"),
        (films.ball_cut_off, "is cut off by the picture's right edge", "with all of the ball in the picture"),
        (films.named_ball_cut_off, "is cut off by the picture's right edge", "with all of the ball in the picture"),
        (films.ball_over_exposed, "is over-exposed", "lower the exposure and lock it"),
        (
            films.one_ball_of_two,
            "only one mirror ball was found, at 19",
            "film the second on the other side of the head",
        ),
        (films.lamp_of_the_phone, "the light comes only from beside the camera", "do not use the phone's own lamp"),
        (films.lamp_on_one_side, "the light comes only from one side", "move another around the head"),
        (films.few_directions, "usable directions of light in", "film half a minute or more"),
        (films.narrow_sweep, "of the space before the face", "from one ear to the other"),
        (films.enhanced, "the camera changes parts of the picture by themselves", "turn off HDR"),
        (films.walked_away, "dark frames only; it is first lost at 2", "sit still"),
        (films.black_without_the_flash, "the face shows nothing that can be followed", "a little brighter"),
        (films.black_about_a_small_circle, "only 0 points of the face can be followed", "a little brighter"),
        (films.nobody, "nothing that the flash lights looks like a head", "--face X,Y,RADIUS"),
        (films.sun_on_the_face, "the person cannot be told from the room", "make the room darker"),
    ],
    ids=lambda value: value.__name__ if callable(value) else "",
)
def test_a_bad_film_is_refused(
    spoil: Callable[[np.ndarray], Shot], what: str, cure: str, good: np.ndarray, out: Path, tmp_path: Path
) -> None:
    shot = spoil(good)
    film = write_film(tmp_path / "film.mp4", shot.codes)
    build(film, shot, out).complains(what, cure)


def _first_half(film: bytes) -> bytes:
    return film[: len(film) // 2]


def _hole_in_the_middle(film: bytes) -> bytes:
    middle = len(film) // 2
    return film[:middle] + bytes(4000) + film[middle + 4000 :]


@pytest.mark.parametrize(
    ("spoil", "what", "cure"),
    [
        (_first_half, "film.mp4 is cut off", "record or copy it again"),
        (_hole_in_the_middle, "film.mp4 is damaged", "copy it again"),
    ],
    ids=["cut off", "damaged"],
)
def test_a_bad_file_is_refused(
    spoil: Callable[[bytes], bytes], what: str, cure: str, good: np.ndarray, out: Path, tmp_path: Path
) -> None:
    film = write_film(tmp_path / "film.mp4", good[:60])
    film.write_bytes(spoil(film.read_bytes()))
    build(film, Shot(good), out).complains(what, cure)


def test_a_refusal_leaves_an_empty_folder_empty(good: np.ndarray, tmp_path: Path) -> None:
    shot = films.too_short(good)
    before = contents(write_film(tmp_path / "film.mp4", shot.codes).parent)
    build(tmp_path / "film.mp4", shot, tmp_path).complains("flashes found")
    assert contents(tmp_path) == before


def test_a_film_that_is_barely_good_enough_gives_warnings(good: np.ndarray, tmp_path: Path) -> None:
    shot = films.drop_before_the_ball(good)
    answer = build(write_film(tmp_path / "film.mp4", shot.codes), shot, tmp_path)
    assert answer.code == 0, answer
    ball, focal = (
        next((line for line in answer.err.splitlines() if words in line), "")
        for words in ("of the ball's outline shows", "the camera's focal length is a guess, give or take 1")
    )
    assert "give its circle with --ball X,Y,RADIUS" in ball
    assert "give it with --focal-px" in focal
    report = json.loads((tmp_path / "me.json").read_text())
    assert report["ball"]["evidence"] < 0.7
    assert report["focal"]["error"] > 0.08
    assert {ball, focal} <= {f"warning: {each}" for each in report["warnings"]}
    assert set(contents(tmp_path)) == {"film.mp4", "me.relit", "me.json"}
