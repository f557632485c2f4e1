"""`relit relight`: one picture of a subject under one light."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer()


@app.command()
def relight(
    context: typer.Context,
    subject: Annotated[str, typer.Argument(help="A stored subject's name, or a .relit file.")],
    out: Annotated[Path, typer.Option(help="Picture to write: .npy, .exr, .png or .jpg.")],
    light: Annotated[str | None, typer.Option(help="One distant light: AZ,EL in degrees; 90,0 is the right.")] = None,
    environment: Annotated[str | None, typer.Option(help="A stored environment's name, or a panorama file.")] = None,
    rotate: Annotated[str, typer.Option(help="Head pose YAW,PITCH,ROLL in degrees.")] = "0,0,0",
    linear: Annotated[bool, typer.Option("--linear", help="Write linear light, unscaled and unclipped.")] = False,
    exposure_ev: Annotated[
        float, typer.Option(help="Brighter or darker than a white ball at 0.8.", min=-10, max=10)
    ] = 0.0,
) -> None:
    """Relight a subject by an environment, or by one distant light of unit irradiance."""
    import numpy as np

    from relit_camera.base.images.image_files import write_display, write_linear
    from relit_camera.base.images.tone_mapping import display_from_linear
    from relit_camera.base.rotations import rotation_from_angles
    from relit_camera.capture.reflectance.directional_light import relight_from_direction
    from relit_camera.cli.arguments import load_command_settings, parse_numbers
    from relit_camera.light.directions import direction_from_degrees
    from relit_camera.light.environments.environment_store import EnvironmentStore
    from relit_camera.light.exposure import auto_exposure_scale
    from relit_camera.light.light_map_rotation import rotate_light_map as rotate_map
    from relit_camera.subject.relighting.basis_relighter import BasisRelighter
    from relit_camera.subject.subject_store import SubjectStore

    if (light is None) == (environment is None):
        raise typer.BadParameter("give either --light or --environment")
    if not linear and out.suffix.lower() in (".npy", ".exr"):
        raise typer.BadParameter(f"{out.suffix} holds linear light: add --linear, or write .png or .jpg")
    storage = load_command_settings(context).storage
    opened = SubjectStore(storage.subjects).resolve(subject)[1]
    head = rotation_from_angles(*parse_numbers(rotate, 3, "--rotate"))
    if light is not None:
        azimuth, elevation = parse_numbers(light, 2, "--light")
        picture = relight_from_direction(opened, head.inv().apply(direction_from_degrees(azimuth, elevation)))
        if not picture.any():
            typer.echo(f"warning: no captured light is near {light}: the picture is black", err=True)
        # A single light has no auto exposure: unit irradiance is shown as it is.
        scale = 1.0
    else:
        room = EnvironmentStore(storage.environments).resolve(environment or "").light_map
        picture = BasisRelighter(opened).relight(rotate_map(room, head)[None])[0]
        scale = auto_exposure_scale(room)
    if linear:
        write_linear(out, picture)
    else:
        write_display(
            out, display_from_linear(picture * np.float32(scale * opened.metadata.display_gain * 2**exposure_ev))
        )
