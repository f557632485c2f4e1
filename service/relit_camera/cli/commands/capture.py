"""`relit capture`: subjects from pictures or from a film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relit_camera.cli.model_offer import Pull

if TYPE_CHECKING:
    from relit_camera.capture.instant.frame_reading import ReadFrames
    from relit_camera.capture.instant.instant_capture import InstantCapture
    from relit_camera.subject.subject import Subject

app = typer.Typer(no_args_is_help=True)


@app.callback()
def group() -> None:
    """Build a subject from pictures or video."""


@app.command("import")
def import_lights(
    lights: Annotated[Path, typer.Argument(help="An RTI .lp file: a count, then 'file x y z' lines.")],
    out: Annotated[Path, typer.Option(help="The subject file to write (.relit).")],
    method: Annotated[str, typer.Option(help="Reflectance method.")] = "default",
    gamma: Annotated[str, typer.Option(help="Transfer curve of the pictures: srgb, linear, or an exponent.")] = "srgb",
    landmarks: Annotated[
        Path | None,
        typer.Option(
            help="JSON of known landmarks: {scheme: [[x, y], …]}; by default landmarks.json beside the pictures."
        ),
    ] = None,
    align: Annotated[
        bool | None,
        typer.Option(
            "--align/--as-is",
            help="Undo small motions and the strobes' varying strength, leave corrupt pictures out; by default, where "
            "that helps.",
        ),
    ] = None,
) -> None:
    """Build a subject from pictures of one person who keeps still, each under one light whose direction is known."""
    from relit_camera.base.images.color import parse_gamma
    from relit_camera.capture.alignment.picture_set_alignment import align_if_better
    from relit_camera.capture.lights_file import read_lights
    from relit_camera.capture.picture_import import import_samples
    from relit_camera.capture.reflectance.method_registry import open_method
    from relit_camera.capture.subject_builder import build_subject
    from relit_camera.capture.subject_landmarks import read_landmarks
    from relit_camera.cli.progress import progress_bar
    from relit_camera.subject.subject_file import write_subject

    curve = parse_gamma(gamma)
    open_method(method)
    with progress_bar() as progress:
        reading = progress.add_task("Reading pictures", total=None)
        samples = import_samples(
            lights, curve, lambda done, total: progress.update(reading, completed=done, total=total)
        )
        aligning = progress.add_task("Aligning them", total=None)
        aligned = align_if_better(
            samples,
            [light.path.name for light in read_lights(lights)],
            align,
            lambda done, total: progress.update(aligning, completed=done, total=total),
        )
        building = progress.add_task("Building the field", total=None)
        points = read_landmarks(landmarks or lights.parent / "landmarks.json", required=landmarks is not None)
        subject = build_subject(
            aligned.samples,
            method,
            lights.name,
            curve,
            points or None,
            progress=lambda done, total: progress.update(building, completed=done, total=total),
        )
    write_subject(out, subject)
    for line in aligned.messages:
        typer.echo(line)
    meta = subject.metadata
    typer.echo(
        f"{out}: {meta.width}x{meta.height}, {meta.lights} lights, {meta.components} components, "
        f"method {meta.method}, every light at {meta.psnr_db:.1f} dB or better, "
        f"{100 * (meta.bytes_share or 0):.1f} % of the dense field"
    )


@app.command("instant")
def instant(
    context: typer.Context,
    out: Annotated[Path, typer.Option(help="The subject file to write (.relit).")],
    source: Annotated[
        str,
        typer.Argument(
            help="A picture or video file of one person who looks into the camera, or a webcam: a name, id or node of "
            "`relit devices`."
        ),
    ] = "webcam",
    pull: Pull = None,
) -> None:
    """Build a subject from three seconds of your webcam, a video or a picture, in the light of the room."""
    from relit_camera.base.concurrency.threads import limit_threads
    from relit_camera.base.storage.atomic_files import atomic_path
    from relit_camera.capture.instant.frame_reading import read_frames
    from relit_camera.capture.instant.instant_capture import capture_instant
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.cli.model_offer import offer_models
    from relit_camera.cli.progress import progress_bar, stage_reporter
    from relit_camera.subject.subject_file import write_subject

    settings = load_command_settings(context)
    offer_models("mesh", "selfie", pull, settings.pull_models)
    limit_threads()
    # Opened before the work, so that a path that cannot be written fails at once.
    with atomic_path(out) as subject_file:
        with progress_bar() as progress:
            report_stage = stage_reporter(progress)
            read = read_frames(source, settings.source, report_stage)
            captured = capture_instant(read.frames, read.source, report_stage)
            report_stage("Looking for expressions", 0, None)
            subject, shown = _with_stills(captured, read)
        write_subject(subject_file, subject)
    for warning in captured.warnings:
        typer.echo(f"warning: {warning}", err=True)
    meta = subject.metadata
    typer.echo(
        f"{out}: {meta.width}x{meta.height}, from {captured.frames} of {len(read.frames)} frames; "
        f"its picture in the estimated light of the room is right to {meta.psnr_db:.0f} dB"
    )
    if shown:
        typer.echo(f"{len(subject.stills)} expression stills: {shown}")


def _with_stills(captured: InstantCapture, read: ReadFrames) -> tuple[Subject, str]:
    """The captured subject with expression stills where its frames show enough, and what they show; else as it is."""
    from dataclasses import replace

    from relit_camera.app.captures.expression_capture import stills_of_frames
    from relit_camera.base.errors import RelitError

    try:
        found = stills_of_frames(captured.subject, read.frames, captured.states, read.source)
    except RelitError:  # somebody who keeps still, as one should: an instant subject needs no stills
        return captured.subject, ""
    return replace(captured.subject, stills=found.stills), ", ".join(found.selection.covered)


@app.command("expressions")
def expressions(
    context: typer.Context,
    video: Annotated[
        Path, typer.Argument(help="A film of the subject's person, who talks and turns: see docs/stills.md.")
    ],
    subject: Annotated[Path, typer.Option(help="The subject file (.relit) that the stills are added to.")],
    out: Annotated[
        Path | None, typer.Option(help="Write the subject with its stills here and leave the other as it is.")
    ] = None,
    pull: Pull = None,
) -> None:
    """Add stills of expressions and turns to a subject: any half-minute film of that person in constant, soft light."""
    from relit_camera.app.captures.expression_capture import capture_expressions
    from relit_camera.base.concurrency.threads import limit_threads
    from relit_camera.base.storage.atomic_files import atomic_path
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.cli.model_offer import offer_models
    from relit_camera.cli.progress import progress_bar, stage_reporter
    from relit_camera.subject.subject_file import read_subject, write_stills

    settings = load_command_settings(context)
    offer_models("mesh", "none", pull, settings.pull_models)
    limit_threads()
    person = read_subject(subject)
    path = out or subject
    with atomic_path(path) as subject_file:
        with progress_bar() as progress:
            captured = capture_expressions(video, person, stage_reporter(progress))
        write_stills(subject, subject_file, captured.stills)
    typer.echo(f"{path}: {len(captured.stills)} stills: {', '.join(captured.selection.covered)}")
    if captured.selection.missing:
        typer.echo(f"not shown yet; for more, film again and {', '.join(captured.selection.missing)}", err=True)


@app.command("build")
def build(
    video: Annotated[
        Path, typer.Argument(help="A film of you, a mirror ball and a blinking lamp: see docs/capture.md.")
    ],
    out: Annotated[Path, typer.Option(help="The subject file to write (.relit).")],
    report: Annotated[Path | None, typer.Option(help="JSON of the results of every stage.")] = None,
    focal_px: Annotated[
        float | None, typer.Option(help="The camera's focal length in pixels of the upright video, where it is known.")
    ] = None,
    ball: Annotated[
        str | None, typer.Option(help="X,Y,RADIUS of the mirror ball in those pixels; by default it is detected.")
    ] = None,
    balls: Annotated[
        int, typer.Option(help="Mirror balls in the film; two of one size measure the lamp's distance.", min=1, max=2)
    ] = 1,
    second_ball: Annotated[
        str | None, typer.Option(help="X,Y,RADIUS of the second ball; with --balls 2 it is detected by default.")
    ] = None,
    face: Annotated[
        str | None, typer.Option(help="X,Y,RADIUS of the face, brow to chin; by default it is detected.")
    ] = None,
    ball_diameter_cm: Annotated[
        float | None,
        typer.Option(
            help="Diameter of the balls; by default they are taken to be as far from the camera as the head.", min=1
        ),
    ] = None,
    light_distance_cm: Annotated[
        float,
        typer.Option(
            help="Usual distance of the lamp from the head, where two balls do not measure it.", min=20, max=1000
        ),
    ] = 100.0,
    size: Annotated[int, typer.Option(help="Pixels a side; fewer where the film shows fewer.", min=64)] = 384,
    method: Annotated[str, typer.Option(help="Reflectance method.")] = "default",
    gamma: Annotated[str, typer.Option(help="Transfer curve of the film: srgb, linear, or an exponent.")] = "srgb",
    subtract_room: Annotated[
        bool | None,
        typer.Option("--subtract-room/--keep-room", help="Subtract the room's light; by default, where that helps."),
    ] = None,
    near_lamp: Annotated[
        bool,
        typer.Option(
            "--near-lamp/--far-lamp",
            help="Correct each pixel for the lamp's nearness; or not, as for a distant lamp.",
        ),
    ] = True,
    threads: Annotated[int, typer.Option(help="Threads of the decoder.", min=1)] = 2,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Start over, even if an interrupted build could be resumed.")
    ] = False,
) -> None:
    """Build a subject from a film of a person, a mirror ball beside them and a blinking lamp that goes around."""
    import json
    from contextlib import nullcontext
    from functools import partial

    from relit_camera.app.captures.film.film_coda import with_coda_stills
    from relit_camera.base.images.color import parse_gamma
    from relit_camera.base.storage.atomic_files import atomic_path
    from relit_camera.capture.film.ball.sphere_projection import BallOutline
    from relit_camera.capture.film.face_circle import FaceCircle
    from relit_camera.capture.film.pipeline.capture_options import CaptureOptions
    from relit_camera.capture.film.pipeline.checkpoint import CheckpointFolder, input_fingerprint
    from relit_camera.capture.film.pipeline.film_subject import build_film_subject
    from relit_camera.capture.reflectance.method_registry import open_method
    from relit_camera.cli.progress import progress_bar, stage_reporter
    from relit_camera.subject.subject_file import write_subject

    options = CaptureOptions(
        gamma=parse_gamma(gamma),
        size=size,
        focal_px=focal_px,
        balls=2 if second_ball else balls,
        second_ball=BallOutline(*_circle(second_ball, "--second-ball")) if second_ball else None,
        ball=BallOutline(*_circle(ball, "--ball")) if ball else None,
        face=FaceCircle(*_circle(face, "--face")) if face else None,
        ball_diameter_cm=ball_diameter_cm,
        light_distance_cm=light_distance_cm,
        subtract_room=subtract_room,
        near_field=near_lamp,
        threads=threads,
    )
    open_method(method)
    checkpoint_folder = CheckpointFolder(out, input_fingerprint(video, options), partial(typer.echo, err=True))
    # Opened before the work, so that a path that cannot be written fails at once; both files appear at its end only.
    with (
        checkpoint_folder.keep_until_done(),
        atomic_path(out) as subject_file,
        atomic_path(report) if report else nullcontext() as report_file,
    ):
        if fresh:
            checkpoint_folder.remove()
        with progress_bar() as progress:
            report_stage = stage_reporter(progress)
            subject, told = build_film_subject(video, options, checkpoint_folder, report_stage, method)
            subject, coda = with_coda_stills(video, video.name, told, subject, report_stage)
        write_subject(subject_file, subject)
        if report_file:
            report_file.write_text(json.dumps(told, indent=1), encoding="utf-8")
    for warning in told["warnings"]:
        typer.echo(f"warning: {warning}", err=True)
    meta, flashes = subject.metadata, told["light"]["frames"]
    typer.echo(
        f"{out}: {meta.width}x{meta.height}, {meta.lights} lights of {flashes} flashes' frames, "
        f"method {meta.method}, every light at {meta.psnr_db:.1f} dB or better"
    )
    if coda:
        typer.echo(coda, err=not subject.stills)


@app.command("desk")
def desk(
    context: typer.Context,
    frames: Annotated[
        Path, typer.Option(help="A folder of webcam frames and desk.json, as docs/formats.md describes.")
    ],
    out: Annotated[Path, typer.Option(help="The subject file to write (.relit).")],
    pull: Pull = None,
) -> None:
    """Build a subject from frames filmed while your own screen lit you in patterns: see docs/desk.md."""
    from relit_camera.base.concurrency.threads import limit_threads
    from relit_camera.base.storage.atomic_files import atomic_path
    from relit_camera.capture.desk.desk_capture import build_desk_subject
    from relit_camera.capture.desk.desk_recording import read_desk_recording
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.cli.model_offer import offer_models
    from relit_camera.cli.progress import progress_bar, stage_reporter
    from relit_camera.subject.subject_file import write_subject

    recording = read_desk_recording(frames)
    offer_models("mesh", "selfie", pull, load_command_settings(context).pull_models)
    limit_threads()
    with atomic_path(out) as subject_file, progress_bar() as progress:
        subject, warnings = build_desk_subject(recording, frames.resolve().name, stage_reporter(progress))
        write_subject(subject_file, subject)
    for warning in warnings:
        typer.echo(f"warning: {warning}", err=True)
    meta = subject.metadata
    typer.echo(f"{out}: {meta.width}x{meta.height}, {meta.lights} patches of the screen")


def _circle(text: str, option: str) -> tuple[float, float, float]:
    """X, Y and radius of an option, or a usage error."""
    from relit_camera.cli.arguments import parse_numbers

    x, y, radius = parse_numbers(text, 3, option)
    if not radius > 0:
        raise typer.BadParameter(f"a radius of {radius:g} pixels", param_hint=option)
    return x, y, radius
