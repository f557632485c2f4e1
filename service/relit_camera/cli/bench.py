"""`relit bench`: how fast this machine is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer()


@app.command()
def bench(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable.")] = False,
    subject: Annotated[str | None, typer.Option(help="Subject to measure; a generated one if not given.")] = None,
    environments: Annotated[Path | None, typer.Option(help="Folder of panoramas besides our own.")] = None,
    video: Annotated[
        str | None, typer.Option(help="Live source; the test pattern with a made-up face if not given.")
    ] = None,
    tracker: Annotated[str | None, typer.Option(help="Tracker for the video.")] = None,
    mode: Annotated[str, typer.Option(help="Mode of the live chain.")] = "reenact",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the live chain.")] = "1280x720",
    seconds: Annotated[float, typer.Option(help="Length of the live measurement; 0 leaves it out.", min=0)] = 10.0,
) -> None:
    """Measure relighting by every implementation, and each stage of the live chain. Let nothing else run."""
    import json

    from relit_camera.bench.live import NoddingTracker, bench_live
    from relit_camera.bench.machine import machine
    from relit_camera.bench.relighting import bench_relighting
    from relit_camera.bench.sample_subject import sample_subject
    from relit_camera.bench.transfer import bench_transfer
    from relit_camera.cli.parse import mode as parse_mode
    from relit_camera.cli.parse import size as parse_size
    from relit_camera.cli.settings import settings_of
    from relit_camera.config.look import Look
    from relit_camera.cores import leave_to_stay, share_cores
    from relit_camera.errors import NotFoundError
    from relit_camera.light.maps import resample
    from relit_camera.light.panorama import read_panorama
    from relit_camera.stream.assembly import make_tracker, session_options
    from relit_camera.stream.director import Director
    from relit_camera.stream.sources.factory import open_source
    from relit_camera.subject.store import SubjectStore

    width, height = parse_size(size)
    look = Look(mode=parse_mode(mode))
    if environments is not None and not environments.is_dir():
        raise NotFoundError(f"no folder {environments}", "name a folder with .hdr or .exr files")
    overrides = {
        "source": {"source": video or "pattern", "width": width, "height": height},
        "output": {"sink": "null", "width": width, "height": height},
        "tracker": {"name": tracker},
    }
    settings = settings_of(context, **overrides)
    share_cores()
    before = machine()
    options = session_options(settings.inference)
    director = Director(settings.storage)
    # What is missing shall be said before minutes of measuring, not after.
    source = open_source(settings.source)
    followed = NoddingTracker() if video is None else make_tracker(settings)
    measured = sample_subject() if subject is None else SubjectStore(settings.storage.subjects).resolve(subject)[1]
    maps = {name: director.environments.load(name).light_map for name in director.environments.names()}
    if environments is not None:
        files = sorted(path for path in environments.iterdir() if path.suffix in (".hdr", ".exr"))
        maps |= {path.stem: resample(read_panorama(path).radiance) for path in files}
    result: dict[str, object] = {"relight": bench_relighting(measured, maps, options)}
    result["transfer"] = bench_transfer(options)
    if seconds:
        director.show_subject("bench", sample_subject(256, 256) if subject is None else measured)
        director.set_look(look)
        leave_to_stay()  # as `relit run` does
        result |= bench_live(settings, director, source, followed, seconds)
    result["machine"] = before
    typer.echo(json.dumps(result, indent=2) if as_json else _text(result))


def _text(result: dict[str, object], indent: int = 0) -> str:
    lines = []
    for name, value in result.items():
        if isinstance(value, dict):
            lines += [" " * indent + f"{name}:", _text(value, indent + 2)]
        else:
            lines.append(" " * indent + f"{name}: " + (f"{value:.3f}" if isinstance(value, float) else f"{value}"))
    return "\n".join(lines)
