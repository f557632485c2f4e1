"""`relit track`: tracks the face in a video and writes the result."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from relit_camera.cli.model_offer import Pull

app = typer.Typer()


@app.command()
def track(
    context: typer.Context,
    video: Annotated[Path, typer.Argument(help="The video.")],
    out: Annotated[Path, typer.Option(help="JSON to write; --tracker recorded:FILE plays it back.")],
    tracker: Annotated[str | None, typer.Option(help="mesh or openseeface.")] = None,
    pull: Pull = None,
) -> None:
    """Follow the face in a video and write, per frame, its pose, landmarks, eyes and mouth."""
    from relit_camera.app.wiring import make_tracker
    from relit_camera.base.concurrency.threads import limit_threads
    from relit_camera.base.errors import VideoError
    from relit_camera.base.video.video_readers import VideoReader
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.cli.model_offer import offer_models
    from relit_camera.cli.progress import progress_bar
    from relit_camera.face.tracking.track_recording import TrackRecorder

    limit_threads()
    settings = load_command_settings(context, tracker={"name": tracker})
    offer_models(settings.tracker.name, "", pull, settings.pull_models)
    opened = make_tracker(settings)
    with VideoReader(video) as reader, progress_bar() as progress:
        recorder = TrackRecorder(opened, (reader.info.width, reader.info.height), reader.info.fps)
        task = progress.add_task("Tracking", total=reader.info.frames or None)
        for frame in reader:
            recorder.add(opened.track(frame), frame.time_s)
            progress.advance(task)
    if not recorder.found_fraction:
        raise VideoError(
            f"no face was found in {video}", "the face must look toward the camera, 60 pixels high or more"
        )
    recorder.write(out)
    typer.echo(f"{out}: face found in {100 * recorder.found_fraction:.0f} % of the frames")
