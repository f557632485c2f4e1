"""`relit demo`: the product, shown with a bundled person; needs no webcam, network, download or virtual camera."""

from __future__ import annotations

from typing import Annotated

import typer

from relit_camera.cli.model_offer import Pull

app = typer.Typer()


@app.command()
def demo(
    context: typer.Context,
    headless: Annotated[bool, typer.Option("--headless", help="Do not open the page in a browser.")] = False,
    seconds: Annotated[float | None, typer.Option(min=0, help="End after so long; until Ctrl-C if not given.")] = None,
    host: Annotated[str | None, typer.Option(help="Address of API and panel; loopback, or a token is set.")] = None,
    port: Annotated[int | None, typer.Option(help="Port of API and panel; 0 picks one.")] = None,
    pull: Pull = None,
) -> None:
    """Show a bundled person in one place after another; whoever touches the panel takes over."""
    import time
    from collections.abc import Iterator
    from contextlib import contextmanager

    import psutil

    from relit_camera.app.camera_service import CameraService
    from relit_camera.app.demo import demo_files
    from relit_camera.app.demo.tour import DemoRunner, tour_at
    from relit_camera.app.run_camera import run_camera
    from relit_camera.base.config.settings import OutputSettings
    from relit_camera.base.errors import DeviceError
    from relit_camera.cli.arguments import load_command_settings
    from relit_camera.cli.model_offer import offer_models
    from relit_camera.devices.sinks.sink import NullSink, Sink
    from relit_camera.devices.sinks.sink_factory import open_sink
    from relit_camera.doctor.camera_checks import check_camera
    from relit_camera.live.status.camera_status import CameraState

    def camera_or_nothing(output: OutputSettings) -> Sink:
        try:
            return open_sink(output)
        except DeviceError as error:
            typer.echo(f"No virtual camera, so the page alone shows it: {error.what} (relit doctor tells the cure)")
            return NullSink((output.width, output.height))

    offer_models("mesh", "selfie", pull, load_command_settings(context).pull_models)
    tracker = demo_files.tracker_of_clip()
    if tracker != "mesh":
        typer.echo("No public models (relit models pull gets them): the clip's own record tells where the face is")
    settings = load_command_settings(
        context,
        source={"source": str(demo_files.CLIP)},
        output={"unlit_allowed": True},  # the clip as filmed is part of the tour
        tracker={"name": tracker},
        matte=demo_files.matte_of_clip(),
        server={"host": host, "port": port},
    )
    _, look = tour_at(0.0)
    # Replaces the user's own look, without merging: a color of theirs is no part of another kind of background.
    subject = demo_files.noted_subject(settings.storage.data_dir / "demo")
    settings = settings.model_copy(update={"look": look, "subject": str(subject)})

    @contextmanager
    def demo_tour(camera_service: CameraService, url: str) -> Iterator[None]:
        def live() -> bool:
            if camera_service.status().state is not CameraState.LIVE:
                return False
            seconds_ago = time.time() - psutil.Process().create_time()
            typer.echo(f"First picture {seconds_ago:.1f} s after the command; Ctrl-C ends it")
            return True

        demo_runner = DemoRunner(
            camera_service.scene_controller,
            live,
            lambda caption: camera_service.events.publish("caption", text=caption),
        )
        demo_runner.start()
        try:
            if not headless and not opens_in_browser(url):
                typer.echo(f"Open {url} in a browser to see it")
            yield
        finally:
            demo_runner.stop()

    run_camera(settings, side_task=demo_tour, seconds=seconds, sink_for=camera_or_nothing, checks=check_camera)


def opens_in_browser(url: str) -> bool:
    """Open the page in a graphical browser, if there is one. Returns whether it was opened.

    A text browser would show no picture, and take Ctrl-C.
    """
    import os
    import sys
    import webbrowser

    if sys.platform == "linux" and not os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY", "BROWSER"}:
        return False
    return webbrowser.open(url)
