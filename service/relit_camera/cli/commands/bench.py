"""`relit bench`: what a picture of the running camera costs on this machine, and the speed of relighting."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

app = typer.Typer()


@app.command()
def bench(
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Machine-readable.")] = False,
    subject: Annotated[
        str | None, typer.Option(help="Subject to measure; the bundled one (relighting: a generated one) if not given.")
    ] = None,
    environments: Annotated[Path | None, typer.Option(help="Folder of panoramas besides our own.")] = None,
    video: Annotated[
        str | None, typer.Option(help="Source of the camera, a film of a face; the bundled clip if not given.")
    ] = None,
    tracker: Annotated[str | None, typer.Option(help="Tracker for the video.")] = None,
    mode: Annotated[
        list[str] | None, typer.Option(help="live or portrait; may be repeated. Both if not given.")
    ] = None,
    background: Annotated[
        list[str] | None, typer.Option(help="none, blur, …; may be repeated. none and blur if not given.")
    ] = None,
    size: Annotated[
        list[str] | None, typer.Option(help="WIDTHxHEIGHT of source and pictures; may be repeated. [1280x720]")
    ] = None,
    source_fps: Annotated[
        float | None,
        typer.Option(
            help="Play the video at this rate instead of its own. A slow one: a busy machine then drops no frames, "
            "whose decoding would count.",
            min=1,
        ),
    ] = None,
    seconds: Annotated[float, typer.Option(help="How long each camera is measured; 0 measures none.", min=0)] = 10.0,
    relighting: Annotated[
        bool, typer.Option("--relighting/--no-relighting", help="Measure every implementation of relighting as well.")
    ] = True,
    curves: Annotated[
        Path | None,
        typer.Option(
            help="Measure cost curves instead (pixels, rank, lamps, viewers), and write their plots and curves.json "
            "into this folder. The options that say what the camera shows do not matter then.",
            metavar="FOLDER",
        ),
    ] = None,
) -> None:
    """Measure processor time, latency and memory of the camera, and relighting by every implementation.

    Each combination of mode, background and size is a camera of its own, measured one after another: without options
    four, some 80 seconds in all. Run nothing else meanwhile.
    """
    if curves is not None:
        _measure_curves(curves, as_json)
        return
    import json

    from relit_camera.app.demo import demo_files
    from relit_camera.app.wiring import session_options
    from relit_camera.base.errors import NotFoundError
    from relit_camera.cli.arguments import load_command_settings, parse_background, parse_mode, parse_size
    from relit_camera.devices.sources.source_factory import open_source
    from relit_camera.lab.bench.camera_cost import bundled_settings, measure_cameras
    from relit_camera.lab.bench.cost_text import cost_text
    from relit_camera.lab.bench.machine_info import machine_info
    from relit_camera.lab.bench.relighting_benchmark import benchmark_gpu_transfer, benchmark_relighting
    from relit_camera.lab.bench.synthetic_subject import synthetic_subject
    from relit_camera.light.environments.environment_panorama import read_panorama
    from relit_camera.light.light_map import LightMap, resample_to_light_map
    from relit_camera.live.scene.scene_controller import SceneController
    from relit_camera.subject.subject_store import SubjectStore

    modes = [parse_mode(each) for each in mode or ["live", "portrait"]]
    backgrounds = [parse_background(each) for each in background or ["none", "blur"]]
    sizes = [parse_size(each) for each in size or ["1280x720"]]
    if environments is not None and not environments.is_dir():
        raise NotFoundError(f"no folder {environments}", "name a folder with .hdr or .exr files")
    settings = load_command_settings(context, source={"source": video}, subject=subject, tracker={"name": tracker})
    if video is None:
        settings = bundled_settings(settings)
    elif subject is None:
        settings = settings.model_copy(update={"subject": settings.named_subject or str(demo_files.SUBJECT)})
    if tracker is not None:
        settings = settings.model_copy(update={"tracker": settings.tracker.model_copy(update={"name": tracker})})
    result: dict[str, Any] = {"machine": machine_info()}
    # Open everything before the long measurements, so that missing files are reported at once.
    measured = SubjectStore(settings.storage.subjects).resolve(subject)[1] if subject else None
    maps: dict[str, LightMap] = {}
    if environments is not None:
        files = sorted(path for path in environments.iterdir() if path.suffix in (".hdr", ".exr"))
        maps |= {path.stem: resample_to_light_map(read_panorama(path).radiance) for path in files}
    open_source(settings.source).close()
    if relighting:  # building a subject and painting environments takes ten seconds
        measured = measured or synthetic_subject()
        stored = SceneController(settings.storage).environments
        maps = {name: stored.load(name).light_map for name in stored.names()} | maps
    if seconds:
        result["camera"] = []
        for cost in measure_cameras(settings, sizes, modes, backgrounds, source_fps, seconds):
            result["camera"].append(cost.as_json())
            if not as_json:
                typer.echo(f"{cost_text(cost)}\n")
    if relighting:
        options = session_options(settings.inference)
        assert measured is not None
        result["relight"] = benchmark_relighting(measured, maps, options)
        result["transfer"] = benchmark_gpu_transfer(options)
    typer.echo(json.dumps(result, indent=2) if as_json else _text({**result, "camera": None}))


def _measure_curves(folder: Path, as_json: bool) -> None:
    """Measure the cost curves one after another, and write them into the folder, which is made where it is missing."""
    from relit_camera.app.demo import demo_files
    from relit_camera.base.storage.atomic_files import make_folder
    from relit_camera.base.video.video_readers import VideoReader
    from relit_camera.lab.bench.curves.curve_files import RECORD, write_curves
    from relit_camera.lab.bench.curves.light_curve import light_curve
    from relit_camera.lab.bench.curves.preview_curve import preview_curve
    from relit_camera.lab.bench.curves.relighting_curves import relighting_curves
    from relit_camera.lab.bench.machine_info import machine_info
    from relit_camera.lab.bench.mesh_run import MeshRun
    from relit_camera.lab.evaluate.report.html_page import require_report_packages
    from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES, builtin_environment

    require_report_packages()
    make_folder(folder)
    machine, mesh = machine_info(), MeshRun()
    with VideoReader(demo_files.CLIP) as reader:
        picture = next(iter(reader)).image
    found = [
        *relighting_curves(mesh),
        light_curve(mesh, builtin_environment(BUILTIN_NAMES[0])),
        preview_curve(mesh, picture),
    ]
    files = write_curves(folder, found, machine)
    if as_json:
        typer.echo((folder / RECORD).read_text(), nl=False)
    else:
        typer.echo("\n\n".join([*(curve.text() for curve in found), "\n".join(map(str, files))]))


def _text(result: dict[str, Any], indent: int = 0) -> str:
    lines = []
    for name, value in result.items():
        if isinstance(value, dict):
            lines += [" " * indent + f"{name}:", _text(value, indent + 2)]
        elif value is not None:
            lines.append(" " * indent + f"{name}: " + (f"{value:.3f}" if isinstance(value, float) else f"{value}"))
    return "\n".join(lines)
