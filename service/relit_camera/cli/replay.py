"""`relit replay`: a recorded video, relit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer()


@app.command()
def replay(
    context: typer.Context,
    video: Annotated[Path, typer.Argument(help="The driving video.")],
    subject: Annotated[str, typer.Option(help="A stored subject's name, or a .relit file.")],
    environment: Annotated[str, typer.Option(help="A stored environment's name, or a panorama file.")],
    out: Annotated[Path, typer.Option(help="Video to write: .mp4, .mkv or .mov, at the driving video's size.")],
    report: Annotated[Path | None, typer.Option(help="JSON to write: state, pose and times of each frame.")] = None,
    mode: Annotated[str, typer.Option(help="reenact or ratio.")] = "reenact",
    tracker: Annotated[str | None, typer.Option(help="mesh, openseeface, or recorded:TRACK.json.")] = None,
    background: Annotated[str, typer.Option(help="none, blur, environment, or #RRGGBB.")] = "none",
    rotate: Annotated[str, typer.Option(help="YAW,PITCH,ROLL of the environment, in degrees.")] = "0,0,0",
    exposure_ev: Annotated[float, typer.Option(help="Brighter or darker.")] = 0.0,
    contact_sheet: Annotated[Path | None, typer.Option(help="PNG of a dozen frames, live above relit.")] = None,
) -> None:
    """Relight a recorded video: the subject under the environment, moved as the face in the video moves."""
    import json
    import sys

    from rich.console import Console
    from rich.progress import Progress

    from relit_camera.cli.parse import background as parse_background
    from relit_camera.cli.parse import mode as parse_mode
    from relit_camera.cli.parse import numbers
    from relit_camera.cli.settings import settings_of
    from relit_camera.config.look import Lighting, Look
    from relit_camera.cores import share_cores
    from relit_camera.files import write_atomic
    from relit_camera.space.picture_files import write_display
    from relit_camera.stream.assembly import make_pipeline, make_tracker
    from relit_camera.stream.director import Director
    from relit_camera.stream.replay import replay as run_replay
    from relit_camera.stream.video import probe

    settings = settings_of(context, tracker={"name": tracker})
    yaw, pitch, roll = numbers(rotate, 3, "--rotate")
    share_cores()
    chosen_background, chosen_mode = parse_background(background), parse_mode(mode)
    info = probe(video)
    director = Director(settings.storage)
    director.set_subject(subject)
    lighting = Lighting(
        environment=director.admit_environment(environment),
        yaw_deg=yaw,
        pitch_deg=pitch,
        roll_deg=roll,
        exposure_ev=exposure_ev,
    )
    director.set_look(Look(lighting=lighting, background=chosen_background, mode=chosen_mode))
    track = make_tracker(settings)
    pipelines = []

    def pipeline_for(size: tuple[int, int]):  # type: ignore[no-untyped-def]
        pipelines.append(make_pipeline(settings, track, size))
        return pipelines[0]

    every = max((info.frames or 96) // 12, 1)
    kept = []
    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("Relighting", total=info.frames or None)

        def watch(index, before, after):  # type: ignore[no-untyped-def]
            progress.update(task, completed=index + 1)
            if contact_sheet and index % every == every // 2:
                kept.append((f"{index}", before, after))

        frames = run_replay(video, out, pipeline_for, lambda time_s: director.scene, watch)
    for trouble in pipelines[0].troubles:
        print(f"relit: {trouble.what}: {trouble.why}; {trouble.cure}", file=sys.stderr)
    if contact_sheet and kept:
        from relit_camera.compose.sheet import contact_sheet as draw_sheet

        labels, before, after = zip(*kept, strict=True)
        write_display(contact_sheet, draw_sheet([list(before), list(after)], ["live", "relit"], list(labels)))
    if report:
        document = {
            "video": video.name,
            "tracker": track.name,
            "mode": mode,
            "degraded": [vars(trouble) for trouble in pipelines[0].troubles],
            "frames": [frame.as_json() for frame in frames],
        }
        write_atomic(report, json.dumps(document, indent=1))
    found = sum(1 for frame in frames if frame.motion and frame.motion.status == "found")
    typer.echo(f"{out}: {len(frames)} frames, face found in {found}")
