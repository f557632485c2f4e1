"""`relit demo`: the product, shown with a bundled person; needs no webcam, network, download or virtual camera."""

from __future__ import annotations

from typing import Annotated

import typer

app = typer.Typer()


@app.command()
def demo(
    context: typer.Context,
    headless: Annotated[bool, typer.Option("--headless", help="Do not open the page in a browser.")] = False,
    seconds: Annotated[float | None, typer.Option(min=0, help="End after so long; until Ctrl-C if not given.")] = None,
    host: Annotated[str | None, typer.Option(help="Address of API and panel; loopback only.")] = None,
    port: Annotated[int | None, typer.Option(help="Port of API and panel; 0 picks one.")] = None,
) -> None:
    """Show a bundled person in one place after another; whoever touches the panel takes over."""
    import time
    import webbrowser
    from collections.abc import Iterator
    from contextlib import contextmanager

    import psutil

    from relit_camera.cli.serving import run_camera
    from relit_camera.cli.settings import settings_of
    from relit_camera.demo import bundle
    from relit_camera.demo.tour import Guide, tour_at
    from relit_camera.errors import DeviceError, ModelError
    from relit_camera.models.registry import model_path
    from relit_camera.stream.daemon import Daemon
    from relit_camera.stream.sinks.factory import open_sink
    from relit_camera.stream.status import CameraState

    def installed(*models: str) -> bool:
        try:
            return all(model_path(name) for name in models)
        except ModelError:
            return False

    def published(settings_sink: str) -> str:
        if settings_sink != "camera":
            return settings_sink
        try:
            open_sink(settings_of(context).output).close()
        except DeviceError as error:
            typer.echo(f"No virtual camera, so the page alone shows it: {error.what} (relit doctor tells the cure)")
            return "null"
        return "camera"

    tracker = "mesh" if installed("face_mesh", "face_detector_yunet") else f"recorded:{bundle.TRACK}"
    matte = "selfie" if installed("selfie_landscape", "selfie_square") else f"recorded:{bundle.MATTES}"
    if tracker != "mesh":
        typer.echo("No public models (relit models pull gets them): the clip's own record tells where the face is")
    _, look = tour_at(0.0)
    settings = settings_of(
        context,
        source={"source": str(bundle.CLIP)},
        output={"sink": published(settings_of(context).output.sink)},
        subject=str(bundle.SUBJECT),
        look=look.model_dump(mode="json"),
        tracker={"name": tracker},
        matte=matte,
        server={"host": host, "port": port},
    )

    @contextmanager
    def guided(daemon: Daemon, url: str) -> Iterator[None]:
        def live() -> bool:
            if daemon.status().state is not CameraState.LIVE:
                return False
            typer.echo(f"First picture {time.time() - psutil.Process().create_time():.1f} s after the command")
            return True

        guide = Guide(daemon.director, live, lambda caption: daemon.events.publish("caption", text=caption))
        guide.start()
        if not headless and not webbrowser.open(url):
            typer.echo(f"Open {url} in a browser to see it")
        try:
            yield
        finally:
            guide.stop()

    run_camera(settings, beside=guided, seconds=seconds)
