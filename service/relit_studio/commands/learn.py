"""`learn`: what instant capture knows of how heads answer light."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from relit_camera.base.errors import CaptureError, InputError
from relit_camera.base.storage.atomic_files import atomic_path
from relit_camera.capture.picture_import import import_samples
from relit_studio.commands.options import Out, Threads, load_person, shown_progress
from relit_studio.cycles.job import Quality
from relit_studio.field.field_renderer import FieldSettings, render_field
from relit_studio.field.learned_response.known_response import KnownResponse, known_response
from relit_studio.field.learned_response.network_fit import fit_network, mean_error
from relit_studio.field.learned_response.training_lights import training_lights

LAMP_DEG = 30.0
LIGHTS = 24
HELD = 5
"""Of each five people one is held out of the first fit, which tells how good it is on people it has not seen."""
RESULT = "learned_response.npz"


def learn(
    out: Out,
    first: Annotated[int, typer.Option(min=0, help="Number of the first random person.")] = 201,
    people: Annotated[int, typer.Option(min=2, max=999, help="How many, numbered from there.")] = 24,
    threads: Threads = 2,
) -> None:
    """Render random people under lamps all round (a minute each), and train the network of instant capture on them."""
    numbers = [str(first + index) for index in range(people)]
    lights = training_lights(LIGHTS)
    known: dict[str, KnownResponse] = {}
    for number in numbers:
        folder = out / number
        _render(number, folder, threads)
        try:
            known[number] = known_response(import_samples(folder / "lights.lp"), lights, LAMP_DEG)
        except CaptureError as error:
            typer.echo(f"{number} is left out: {error}")
    if len(known) < 2:
        raise InputError("too few people are left to learn from", "name more of them by --people")
    held = list(known)[::HELD]
    network = fit_network([person for number, person in known.items() if number not in held])
    for number in held:
        generic, learned = (mean_error(each, known[number]) for each in (None, network))
        typer.echo(f"{number}, held out: error {generic:.3f} as a generic head, {learned:.3f} as learned")
    network = fit_network(list(known.values()))
    errors = np.mean([[mean_error(each, person) for each in (None, network)] for person in known.values()], axis=0)
    with atomic_path(out / RESULT) as temporary:
        network.write(temporary)
    typer.echo(f"all {len(known)}, trained on: error {errors[0]:.3f} as generic heads, {errors[1]:.3f} as learned")
    typer.echo(f"{out / RESULT}")


def _render(number: str, folder: Path, threads: int) -> None:
    settings = FieldSettings(lights=48, size=112, light_size_deg=LAMP_DEG, quality=Quality(8, threads=threads))
    with shown_progress(f"person {number}") as progress:
        render_field(load_person(number), folder, settings, progress)
