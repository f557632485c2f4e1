"""`relit replay`: a recorded video, relit."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relit_camera.cli.model_offer import Pull

if TYPE_CHECKING:
    from collections.abc import Sequence

    from relit_camera.app.replay.video_replay import ReplayedFrame
    from relit_camera.base.config.settings import RelitSettings
    from relit_camera.subject.subject import Subject

app = typer.Typer()

SHEET_FRAMES = 12
"""A contact sheet has at least this many frames of a longer video, and fewer than twice as many."""


@app.command()
def replay(
    context: typer.Context,
    video: Annotated[Path, typer.Argument(help="The driving video.")],
    environment: Annotated[str, typer.Option(help="A stored environment's name, or a panorama file.")],
    out: Annotated[Path, typer.Option(help="Video to write: .mp4, .mkv or .mov, at the driving video's size.")],
    subject: Annotated[str | None, typer.Option(help="A stored subject's name, or a .relit file.")] = None,
    instant: Annotated[bool, typer.Option("--instant", help="Capture the subject from the video itself.")] = False,
    report: Annotated[Path | None, typer.Option(help="JSON to write: state, pose and times of each frame.")] = None,
    mode: Annotated[str, typer.Option(help="live or portrait.")] = "live",
    avatar: Annotated[
        bool, typer.Option("--avatar", help="Allow others than the subject to move the portrait (mode portrait).")
    ] = False,
    tracker: Annotated[str | None, typer.Option(help="mesh, openseeface, or recorded:TRACK.json.")] = None,
    background: Annotated[str, typer.Option(help="none, blur, environment, or #RRGGBB.")] = "none",
    rotate: Annotated[str, typer.Option(help="YAW,PITCH,ROLL of the environment, in degrees.")] = "0,0,0",
    exposure_ev: Annotated[float, typer.Option(help="Brighter or darker.")] = 0.0,
    contact_sheet: Annotated[Path | None, typer.Option(help="PNG or JPEG of some frames, live above relit.")] = None,
    pull: Pull = None,
) -> None:
    """Relight a recorded video.

    Without a subject, whoever is in it is lit as an average head of their skin would be; with one, the better for it.
    """
    import json
    import sys
    from contextlib import ExitStack

    from relit_camera.app.replay.video_replay import replay as run_replay
    from relit_camera.app.wiring import make_pipeline, make_tracker
    from relit_camera.base.concurrency.threads import limit_threads
    from relit_camera.base.config.look import ANYONE, Look, Mode
    from relit_camera.base.images.contact_sheet import contact_sheet as draw_sheet
    from relit_camera.base.images.image_files import encode_display
    from relit_camera.base.images.image_types import DisplayImage
    from relit_camera.base.storage.atomic_files import atomic_path
    from relit_camera.base.video.video_readers import probe_video
    from relit_camera.cli.arguments import load_command_settings, parse_background, parse_lighting, parse_mode
    from relit_camera.cli.model_offer import offer_models
    from relit_camera.cli.progress import progress_bar
    from relit_camera.live.scene.scene_controller import SceneController

    if contact_sheet and contact_sheet.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise typer.BadParameter(f"{contact_sheet} is neither .png nor .jpg", param_hint="--contact-sheet")
    if instant and subject is not None:
        raise typer.BadParameter("give --subject or --instant, not both", param_hint="--subject")
    if video.resolve() == out.resolve():
        raise typer.BadParameter(f"{out} is the driving video itself", param_hint="--out")
    settings = load_command_settings(context, output={"avatar_allowed": avatar or None}, tracker={"name": tracker})
    offer_models(settings.tracker.name, settings.matte, pull, settings.pull_models)
    limit_threads()
    chosen_background, chosen_mode = parse_background(background), parse_mode(mode)
    info = probe_video(video)
    scene_controller = SceneController(settings.storage)
    if subject is not None:
        scene_controller.load_configured_subject(subject)
    elif instant and (captured := _instant_subject(video, settings, chosen_mode is Mode.PORTRAIT)):
        scene_controller.show_subject("instant", captured)
    elif chosen_mode is Mode.PORTRAIT:
        raise typer.BadParameter("portrait needs --subject, or --instant", param_hint="--mode")
    else:
        scene_controller.load_configured_subject(ANYONE)
    scene_controller.set_avatar_allowed(settings.output.avatar_allowed)
    lighting = parse_lighting(scene_controller.register_temporary_environment(environment), rotate, exposure_ev)
    scene_controller.set_look(Look(lighting=lighting, background=chosen_background, mode=chosen_mode))
    track = make_tracker(settings)
    pipelines = []

    def pipeline_for(size: tuple[int, int]):  # type: ignore[no-untyped-def]
        pipelines.append(make_pipeline(settings, track, size))
        return pipelines[0]

    every = max((info.frames or 0) // SHEET_FRAMES, 1)
    kept: list[tuple[int, DisplayImage, DisplayImage]] = []
    with ExitStack() as results, progress_bar() as progress:
        # Opened before the work: a file that cannot be written is reported at once, and leaves no video behind.
        report_file = results.enter_context(atomic_path(report)) if report else None
        sheet_file = results.enter_context(atomic_path(contact_sheet)) if contact_sheet else None
        task = progress.add_task("Relighting", total=info.frames or None)

        def watch(index: int, before: DisplayImage, after: DisplayImage) -> None:
            nonlocal every
            progress.update(task, completed=index + 1)
            if sheet_file and index % every == 0:
                kept.append((index, before, after))
                if len(kept) == 2 * SHEET_FRAMES:  # the file did not state its length: keep every second one
                    del kept[1::2]
                    every *= 2

        frames = run_replay(video, out, pipeline_for, lambda time_s: scene_controller.scene, watch)
        if sheet_file:
            indices, before, after = zip(*kept, strict=True)
            sheet = draw_sheet([list(before), list(after)], ["live", "relit"], [str(index) for index in indices])
            sheet_file.write_bytes(encode_display(sheet, sheet_file.suffix))
        if report_file:
            document = {
                "video": video.name,
                "tracker": track.name,
                "mode": str(chosen_mode),
                "degraded": [vars(trouble) for trouble in pipelines[0].troubles],
                "frames": [frame.as_json() for frame in frames],
            }
            report_file.write_text(json.dumps(document, indent=1), encoding="utf-8")
    for trouble in pipelines[0].troubles:
        print(f"relit: {trouble.what}: {trouble.why}; {trouble.cure}", file=sys.stderr)
    found = sum(1 for frame in frames if frame.motion and frame.motion.status == "found")
    typer.echo(f"{out}: {len(frames)} frames, face found in {found}{_otherwise_shown(frames)}")


def _otherwise_shown(frames: Sequence[ReplayedFrame]) -> str:
    """What was shown in the frames that are not as asked: a clause each."""
    from collections import Counter

    from relit_camera.live.publishing.what_is_shown import Shown

    words = {
        Shown.LAST_LIGHT: "the person in their mean light",
        Shown.PLACE_TINT: "the person in the tint of the place",
        Shown.AT_REST: "the subject at rest",
        Shown.PLACEHOLDER: "a placeholder, for somebody else than the subject,",
    }
    counts = Counter(frame.shown for frame in frames)
    return "".join(f"; {what} in {counts[kind]}" for kind, what in words.items() if counts[kind])


def _instant_subject(video: Path, settings: RelitSettings, not_without: bool) -> Subject | None:
    """The subject that the first seconds of the video give; warnings are printed. None where they show no usable face.

    Raises:
        CaptureError: that is so, and it does not do without.
    """
    from relit_camera.base.errors import CaptureError
    from relit_camera.capture.instant.frame_reading import read_frames
    from relit_camera.capture.instant.instant_capture import capture_instant
    from relit_camera.cli.progress import progress_bar, stage_reporter

    try:
        with progress_bar() as progress:
            report_stage = stage_reporter(progress)
            frames = read_frames(str(video), settings.source, report_stage).frames
            captured = capture_instant(frames, video.name, report_stage)
    except CaptureError as error:
        if not_without:
            raise
        typer.echo(f"warning: {error}; whoever is in it is lit as an average head would be", err=True)
        return None
    for warning in captured.warnings:
        typer.echo(f"warning: {warning}", err=True)
    return captured.subject
