"""`relit run`: runs the camera with its API and panel."""

from __future__ import annotations

from typing import Annotated

import typer

from relit_camera.cli.model_offer import Pull

app = typer.Typer()


@app.command()
def run(
    context: typer.Context,
    source: Annotated[str | None, typer.Option(help="webcam, a camera's id, a video or picture file, pattern.")] = None,
    sink: Annotated[str | None, typer.Option(help="camera, pipewire, a video file, or null.")] = None,
    subject: Annotated[str | None, typer.Option(help="A stored subject's name, a .relit file, or anyone.")] = None,
    instant: Annotated[
        bool, typer.Option("--instant", help="Measure the face before the webcam first, for three seconds.")
    ] = False,
    unlit: Annotated[
        bool, typer.Option("--unlit", help="Allow the picture as filmed, where there is no subject or no face.")
    ] = False,
    avatar: Annotated[
        bool, typer.Option("--avatar", help="Allow others than the subject to move the portrait (mode portrait).")
    ] = False,
    environment: Annotated[str | None, typer.Option(help="A stored environment's name, or a panorama file.")] = None,
    mode: Annotated[
        str | None,
        typer.Option(help="live, or portrait: nothing of the room, or of today's hair and clothes, is sent."),
    ] = None,
    tracker: Annotated[str | None, typer.Option(help="mesh, openseeface, or recorded:TRACK.json.")] = None,
    host: Annotated[str | None, typer.Option(help="Address of API and panel; loopback, or a token is set.")] = None,
    port: Annotated[int | None, typer.Option(help="Port of API and panel; 0 picks one.")] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT of the output.")] = None,
    on_demand: Annotated[
        bool | None, typer.Option("--on-demand/--always-on", help="Release the webcam while nobody looks (Linux).")
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit where a device or model is missing, in place of waiting for it.")
    ] = False,
    pull: Pull = None,
) -> None:
    """Run the camera until it is told to stop (Ctrl-C or SIGTERM)."""
    from functools import partial

    from relit_camera.base.concurrency.threads import paused_gc
    from relit_camera.base.config.settings_loader import config_path, load_settings
    from relit_camera.base.errors import ModelError
    from relit_camera.cli.arguments import load_command_settings, parse_mode, parse_size
    from relit_camera.cli.model_offer import offer_models

    if instant and subject is not None:
        raise typer.BadParameter("--instant makes a subject of its own", param_hint="--subject")
    width, height = parse_size(size) if size else (None, None)
    given = {
        "source": {"source": source, "on_demand": on_demand},
        "output": {
            "sink": sink,
            "width": width,
            "height": height,
            "unlit_allowed": unlit or None,
            "avatar_allowed": avatar or None,
        },
        "subject": subject,
        "look": {"mode": str(parse_mode(mode)) if mode else None},
        "tracker": {"name": tracker},
        "server": {"host": host, "port": port},
    }
    settings = load_command_settings(context, **given)
    try:
        offer_models(settings.tracker.name, settings.matte, pull, settings.pull_models)
    except ModelError as error:
        if strict:
            raise
        typer.echo(str(error), err=True)  # the camera starts all the same, and the panel can try again
    path = config_path((context.find_root().obj or {}).get("config"))
    # Always the same file: if it is deleted, another one must not be read instead.
    load = partial(load_settings, overrides={"log_level": settings.log_level, **given})
    reload = (path.absolute(), load) if path else None
    with paused_gc():
        from relit_camera.app.first_scene import FirstScene
        from relit_camera.live.scene.kept_scene import GivenOptions

        given_options = GivenOptions(subject=subject is not None, mode=mode is not None)
        with FirstScene(settings, environment, instant, given_options) as first_scene:
            # The most of the program is imported meanwhile.
            from relit_camera.app.run_camera import run_camera
            from relit_camera.doctor.camera_checks import check_camera

            run_camera(
                settings,
                environment,
                reload=reload,
                instant=instant,
                strict=strict,
                checks=check_camera,
                given=given_options,
                first_scene=first_scene,
            )
