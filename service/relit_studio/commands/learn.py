"""`learn`: what instant and desk captures know of how heads answer light."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
import typer
from numpy.typing import NDArray

from relit_camera.base.errors import CaptureError, InputError, SubjectError
from relit_camera.base.storage.atomic_files import atomic_path
from relit_camera.capture.instant.response.response_network import ResponseNetwork
from relit_camera.capture.lights_file import LIGHTS_FILE_NAME
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.lab.evaluate.desk_simulation import SCREENS
from relit_camera.lab.evaluate.ladder.known_person import SubjectFolder, known_person
from relit_studio.commands.options import Out, Threads, load_person, shown_progress
from relit_studio.cycles.job import Quality
from relit_studio.field.field_renderer import FieldSettings, render_field
from relit_studio.field.learned_response.field_fit import field_error, fit_field_network
from relit_studio.field.learned_response.known_field import KnownField, known_field
from relit_studio.field.learned_response.known_response import KnownResponse, known_response
from relit_studio.field.learned_response.response_fit import fit_response_network, response_error
from relit_studio.field.learned_response.training_lights import training_lights
from relit_studio.field.screen_renderer import ScreenSettings, render_screen

SIZE = 112
"""Of the pictures, pixels."""
LAMP_DEG = 30.0
LIGHTS = 24
HELD = 5
"""Of each five people one is held out of the first fit, which tells how good it is on people it has not seen."""
RESPONSE, FIELD = "learned_response.npz", "learned_field.npz"
"""Instant's network, and desk's."""

_Known = TypeVar("_Known")


def learn(
    out: Out,
    first: Annotated[int, typer.Option(min=0, help="Number of the first random person.")] = 201,
    people: Annotated[int, typer.Option(min=2, max=999, help="How many, numbered from there.")] = 24,
    threads: Threads = 2,
) -> None:
    """Render random people under lamps and before screens (two minutes each), and train both networks on them."""
    lights = training_lights(LIGHTS)
    responses: dict[str, list[KnownResponse]] = {}
    fields: dict[str, list[KnownField]] = {}
    for number in range(first, first + people):
        name, folder = str(number), out / str(number)
        # Every other person sits before a laptop too.
        screens = list(SCREENS)[: 1 + number % 2]
        _render(name, folder, screens, threads)
        samples = import_samples(folder / LIGHTS_FILE_NAME)
        before = {screen: import_samples(folder / screen / LIGHTS_FILE_NAME) for screen in screens}
        with _left_out(name):
            responses[name] = [known_response(samples, lights, LAMP_DEG)]
        with _left_out(f"{name} before screens"):
            fields[name] = _known_fields(name, samples, before, lights)
    if min(len(responses), len(fields)) < 2:
        raise InputError("too few people are left to learn from", "name more of them by --people")
    _train("instant", responses, fit_response_network, response_error, out / RESPONSE)
    _train("desk", fields, fit_field_network, field_error, out / FIELD)


@contextmanager
def _left_out(what: str) -> Iterator[None]:
    """Say why somebody cannot be learned from, and go on."""
    try:
        yield
    except (CaptureError, SubjectError) as error:
        typer.echo(f"{what} is left out: {error}")


def _known_fields(
    name: str, samples: OlatSamples, screens: Mapping[str, OlatSamples], lights: NDArray[np.float32]
) -> list[KnownField]:
    person = known_person(name, samples, SIZE, SubjectFolder(None), screens)
    return [known_field(person, screen, lights, LAMP_DEG) for screen in screens]


def _train(
    what: str,
    known: Mapping[str, list[_Known]],
    fit: Callable[[Sequence[_Known]], ResponseNetwork],
    error: Callable[[ResponseNetwork | None, _Known], float],
    path: Path,
) -> None:
    """Fit a network to most people, say how wrong it is on the others; then to all, and write it."""
    held = list(known)[::HELD]
    network = fit([each for name, all_of in known.items() if name not in held for each in all_of])
    for name in held:
        untaught, learned = (np.mean([error(each, one) for one in known[name]]) for each in (None, network))
        typer.echo(f"{what}, {name}, held out: error {untaught:.3f} untaught, {learned:.3f} as learned")
    everybody = [each for all_of in known.values() for each in all_of]
    network = fit(everybody)
    untaught, learned = (np.mean([error(each, one) for one in everybody]) for each in (None, network))
    with atomic_path(path) as temporary:
        network.write(temporary)
    typer.echo(f"{what}, all {len(known)}, trained on: error {untaught:.3f} untaught, {learned:.3f} as learned")
    typer.echo(f"{path}")


def _render(name: str, folder: Path, screens: Sequence[str], threads: int) -> None:
    person = load_person(name)
    settings = FieldSettings(lights=48, size=SIZE, light_size_deg=LAMP_DEG, quality=Quality(8, threads=threads))
    with shown_progress(f"person {name}") as progress:
        render_field(person, folder, settings, progress)
    for screen in screens:
        with shown_progress(f"person {name}, {screen}") as progress:
            quality = Quality(16, threads=threads)
            render_screen(person, SCREENS[screen], folder / screen, ScreenSettings(SIZE, quality), progress)
