"""`screen`: a person before a monitor and before a laptop, one patch of light after another."""

from __future__ import annotations

import typer

from relit_camera.capture.lights_file import LIGHTS_FILE_NAME
from relit_camera.lab.evaluate.desk_simulation import SCREENS
from relit_studio.commands.options import (
    Out,
    PersonName,
    Samples,
    Size,
    Threads,
    Truth,
    load_person,
    quality_of,
    shown_progress,
)
from relit_studio.field.screen_renderer import ScreenSettings, render_screen


def screen(
    out: Out,
    who: PersonName = "adam",
    size: Size = 256,
    samples: Samples = None,
    truth: Truth = False,
    threads: Threads = 2,
) -> None:
    """Render a person as the patches of a screen light them, into the folders desk and laptop of DIR.

    With DIR the folder of that person's field of the same size, `relit evaluate ladder` takes these pictures for the
    simulated captures. Run it again to go on after a stop.
    """
    settings = ScreenSettings(size, quality_of(truth, samples, threads))
    person = load_person(who)
    for name, setup in SCREENS.items():
        with shown_progress(name) as progress:
            render_screen(person, setup, out / name, settings, progress)
    if (out / LIGHTS_FILE_NAME).is_file():
        typer.echo(f"relit evaluate ladder {out} --rung desk --rung laptop --out ladder")
