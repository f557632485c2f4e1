"""`relit bench`: speed of relighting and of the live pipeline on this machine."""

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
    mode: Annotated[str, typer.Option(help="Mode of the live pipeline.")] = "reenact",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the live pipeline.")] = "1280x720",
    seconds: Annotated[float, typer.Option(help="Length of the live measurement; 0 leaves it out.", min=0)] = 10.0,
) -> None:
    """Measure relighting by every implementation, and each stage of the live pipeline. Run nothing else meanwhile."""
    import json

    from relit_camera.app.wiring import make_tracker, session_options
    from relit_camera.base.concurrency.threads import freeze_gc, limit_threads
    from relit_camera.base.config.look import Look
    from relit_camera.base.errors import NotFoundError
    from relit_camera.cli.arguments import load_command_settings, parse_mode, parse_size
    from relit_camera.devices.sources.source_factory import open_source
    from relit_camera.lab.bench.live_benchmark import SyntheticTracker, benchmark_live
    from relit_camera.lab.bench.machine_info import machine_info
    from relit_camera.lab.bench.relighting_benchmark import benchmark_gpu_transfer, benchmark_relighting
    from relit_camera.lab.bench.synthetic_subject import synthetic_subject
    from relit_camera.light.environments.environment_panorama import read_panorama
    from relit_camera.light.light_map import resample_to_light_map
    from relit_camera.live.scene.scene_controller import SceneController
    from relit_camera.subject.subject_store import SubjectStore

    width, height = parse_size(size)
    look = Look(mode=parse_mode(mode))
    if environments is not None and not environments.is_dir():
        raise NotFoundError(f"no folder {environments}", "name a folder with .hdr or .exr files")
    overrides = {
        "source": {"source": video or "pattern", "width": width, "height": height},
        "output": {"sink": "null", "width": width, "height": height},
        "tracker": {"name": tracker},
    }
    settings = load_command_settings(context, **overrides)
    limit_threads()
    before = machine_info()
    options = session_options(settings.inference)
    scene_controller = SceneController(settings.storage)
    # Open everything before the long measurements, so that missing files are reported at once.
    source = open_source(settings.source)
    face_tracker = SyntheticTracker() if video is None else make_tracker(settings)
    measured = synthetic_subject() if subject is None else SubjectStore(settings.storage.subjects).resolve(subject)[1]
    maps = {name: scene_controller.environments.load(name).light_map for name in scene_controller.environments.names()}
    if environments is not None:
        files = sorted(path for path in environments.iterdir() if path.suffix in (".hdr", ".exr"))
        maps |= {path.stem: resample_to_light_map(read_panorama(path).radiance) for path in files}
    result: dict[str, object] = {"relight": benchmark_relighting(measured, maps, options)}
    result["transfer"] = benchmark_gpu_transfer(options)
    if seconds:
        scene_controller.show_subject("bench", synthetic_subject(256, 256) if subject is None else measured)
        scene_controller.set_look(look)
        freeze_gc()  # as `relit run` does
        result |= benchmark_live(settings, scene_controller, source, face_tracker, seconds)
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
