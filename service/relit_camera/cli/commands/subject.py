"""`relit subject`: look into subject files, and make them small."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from relit_camera.subject.subject import Subject

app = typer.Typer(no_args_is_help=True)

GEOMETRY = ("normals", "albedo", "depth", "horizons")
"""Parts of a subject that describe the shape of the head."""


@app.callback()
def group() -> None:
    """Look into subject files, and make them small."""


@app.command()
def info(
    context: typer.Context,
    subject: Annotated[str, typer.Argument(help="A stored subject's name, or a .relit file.")],
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable.")] = False,
    places: Annotated[
        bool, typer.Option("--places", help="Tell how much of each built-in place's light was measured; takes seconds.")
    ] = False,
) -> None:
    """Show what a subject file holds, and how far to trust it."""
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.subject.rungs import describe_places, describe_rung
    from relit_camera.subject.subject_store import SubjectStore

    name, opened = SubjectStore(load_command_settings(context).storage.subjects).resolve(subject)
    shown = {"name": name, **opened.metadata.model_dump(mode="json")}
    shown["landmarks"] = {scheme: len(points) for scheme, points in opened.landmarks.items()}
    shown["geometry"] = [name for name in GEOMETRY if getattr(opened, name) is not None]
    shown["stills"] = len(opened.stills)
    shown["bytes"] = opened.basis.nbytes + opened.coefficients.nbytes + opened.light_coefficients.nbytes
    if places:
        shown["measured_of_places"] = _measured_of_places(opened)
    if as_json:
        typer.echo(json.dumps(shown, indent=2))
        return
    meta = opened.metadata
    typer.echo(describe_rung(meta.rung, meta.expected_db, meta.measured_fraction))
    if places:
        typer.echo(describe_places(shown.pop("measured_of_places")))
    for key, value in shown.items():
        typer.echo(f"{key:17} {value}")


def _measured_of_places(subject: Subject) -> dict[str, float]:
    """The measured fraction of each built-in place's light."""
    from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
    from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
    from relit_camera.subject.measured_light import share_of_light

    maps = {name: builtin_light_map(name) for name in BUILTIN_NAMES}
    return {name: round(share_of_light(each, subject.measured_texels), 3) for name, each in maps.items()}


@app.command()
def pack(
    context: typer.Context,
    subject: Annotated[str, typer.Argument(help="A stored subject's name, or a .relit file.")],
    out: Annotated[Path, typer.Option(help="Subject file to write.", metavar="FILE")],
    components: Annotated[int, typer.Option(min=1, help="Principal pictures to keep.")] = 48,
) -> None:
    """Make a small copy of a subject, to send or ship: fewer principal pictures, of 8 bits each."""
    from statistics import median

    import numpy as np

    from relit_camera.base.images.image_quality import psnr
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
    from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
    from relit_camera.subject.compression.webp_packing import light_psnrs_db, pack_subject
    from relit_camera.subject.relighting.basis_relighter import BasisRelighter
    from relit_camera.subject.subject_file import read_subject, write_subject
    from relit_camera.subject.subject_store import SubjectStore

    _, full = SubjectStore(load_command_settings(context).storage.subjects).resolve(subject)
    write_subject(out, pack_subject(full, components), small=True)
    small = read_subject(out)
    before, after = BasisRelighter(full), BasisRelighter(small)
    maps = np.stack([builtin_light_map(name) for name in BUILTIN_NAMES])
    worst = min(psnr(*pair, full.matte) for pair in zip(after.relight(maps), before.relight(maps), strict=True))
    lights = light_psnrs_db(small, full)
    typer.echo(f"{out}: {out.stat().st_size / 1e6:.1f} MB, {components} of {full.metadata.components} components")
    typer.echo(
        f"built-in environments {worst:.1f} dB or more; single lights {median(lights):.1f} dB, worst {min(lights):.1f}"
    )
