"""Options that several commands share, and their progress bar."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from relit_camera.cli.progress import progress_bar
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_studio.base.progress import Progress
from relit_studio.cycles.job import Quality
from relit_studio.drive.painted_rooms import ROOMS, paint_room
from relit_studio.drive.room import Room
from relit_studio.people.people_assets import people_assets
from relit_studio.people.person import Person, make_person
from relit_studio.people.traits.named_people import find_traits

PersonName = Annotated[str, typer.Option("--person", help="adam, bea, cem, or a number for a random person.")]
Out = Annotated[Path, typer.Option("--out", help="Folder to write to.", metavar="DIR")]
Threads = Annotated[int, typer.Option("--threads", min=1, max=256, help="Of Cycles.")]
Truth = Annotated[
    bool, typer.Option("--truth/--denoise", help="No denoiser and no clamp, for measuring; or denoised, for show.")
]
Samples = Annotated[int | None, typer.Option("--samples", min=1, max=65536, help="A pixel.")]
Size = Annotated[int, typer.Option("--size", min=32, max=4096, help="Of the pictures, pixels.")]
ROOM_HELP = f"One of {', '.join(ROOMS)}; or a stored name or a panorama file."
Environment = Annotated[str, typer.Option("--environment", help=ROOM_HELP)]
Turn = Annotated[float, typer.Option("--turn", help="Of the environment, degrees; > 0 moves its front to the right.")]

SHOW_SAMPLES, TRUTH_SAMPLES = 32, 512


def quality_of(truth: bool, samples: int | None, threads: int, show_samples: int = SHOW_SAMPLES) -> Quality:
    """The quality that the options ask for."""
    if truth:
        return Quality.truth(samples or TRUTH_SAMPLES, threads)
    return Quality(samples or show_samples, threads=threads)


def load_person(name: str) -> Person:
    """The person of the cast or of a number.

    Raises:
        NotFoundError: no such person, or the raw files have not been fetched.
    """
    return make_person(find_traits(name), people_assets())


def load_room(environment: str, turn_deg: float) -> Room:
    """One of the studio's rooms, or a stored environment or panorama file, rotated by `turn_deg`.

    Raises:
        NotFoundError: there is none.
        PanoramaError: the file cannot be used.
    """
    known = paint_room(environment) if environment in ROOMS else EnvironmentStore().resolve(environment)
    return Room(known, turn_deg)


@contextmanager
def shown_progress(what: str) -> Iterator[Progress]:
    """A progress bar on stderr."""
    with progress_bar() as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
