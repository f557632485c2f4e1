"""`relit capture`: from pictures to a subject."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True)


@app.callback()
def group() -> None:
    """Build a subject from pictures or video."""


@app.command("import")
def import_lights(
    lights: Annotated[Path, typer.Argument(help="An RTI .lp file: a count, then 'file x y z' lines.")],
    out: Annotated[Path, typer.Option(help="The subject file to write (.relit).")],
    method: Annotated[str, typer.Option(help="Reflectance method.")] = "default",
    gamma: Annotated[str, typer.Option(help="Curve of the pictures: srgb, linear, or an exponent.")] = "srgb",
    landmarks: Annotated[
        Path | None,
        typer.Option(help="JSON of known landmarks: {scheme: [[x, y], …]}; landmarks.json is found by itself."),
    ] = None,
) -> None:
    """Build a subject from aligned pictures, each under one light whose direction is known."""
    from relit_camera.capture.build import build_subject
    from relit_camera.capture.importing import import_samples
    from relit_camera.capture.landmarks_file import read_landmarks
    from relit_camera.cli.progress import progress_bar
    from relit_camera.reflectance.method import open_method
    from relit_camera.space.colour import parse_gamma
    from relit_camera.subject.file import write_subject

    curve = parse_gamma(gamma)
    open_method(method)
    with progress_bar() as progress:
        reading = progress.add_task("Reading pictures", total=None)
        samples = import_samples(
            lights, curve, lambda done, total: progress.update(reading, completed=done, total=total)
        )
        building = progress.add_task("Building the field", total=None)
        points = read_landmarks(landmarks or lights.parent / "landmarks.json", required=landmarks is not None)
        subject = build_subject(
            samples,
            method,
            lights.name,
            curve,
            points or None,
            progress=lambda done, total: progress.update(building, completed=done, total=total),
        )
    write_subject(out, subject)
    meta = subject.metadata
    typer.echo(
        f"{out}: {meta.width}x{meta.height}, {meta.lights} lights, {meta.components} components, "
        f"method {meta.method}, every light at {meta.psnr_db:.1f} dB or better, "
        f"{100 * (meta.bytes_share or 0):.1f} % of the dense field"
    )
