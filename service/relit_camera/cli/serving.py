"""Running the camera with its API: shared by `relit run` and everything like it."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager

import typer

from relit_camera.api.app import create_app
from relit_camera.api.server import listen, serve
from relit_camera.config.settings import OutputSettings, RelitSettings
from relit_camera.cores import leave_to_stay, share_cores
from relit_camera.files import sweep_unfinished
from relit_camera.stream.assembly import make_tracker
from relit_camera.stream.daemon import Daemon
from relit_camera.stream.director import Director
from relit_camera.stream.sinks.base import Sink
from relit_camera.stream.sinks.factory import open_sink
from relit_camera.stream.sources.factory import open_source

Beside = Callable[[Daemon, str], AbstractContextManager[None]]
"""What else goes on while the camera runs, given the camera and the panel's address."""


def run_camera(
    settings: RelitSettings,
    environment: str | None = None,
    beside: Beside | None = None,
    seconds: float | None = None,
    sink_for: Callable[[OutputSettings], Sink] = open_sink,
) -> None:
    """Run the camera until SIGTERM or SIGINT, then end within 3 s.

    Everything that can be wrong with the settings is found before a device is touched.

    Args:
        settings: of this run.
        environment: a stored environment's name or a panorama file, in place of the settings' own.
        beside: entered when the panel can be reached, left when the camera is about to end.
        seconds: end by itself after so long.
        sink_for: opens what the settings name.

    Raises:
        RelitError: the port is in use, a file, device or model is missing …
    """
    share_cores()
    for folder in settings.storage.folders:
        sweep_unfinished(folder)  # what an earlier run left where it was killed
    look, director = settings.look, Director(settings.storage)
    if environment is not None:
        named = look.lighting.model_copy(update={"environment": director.admit_environment(environment)})
        look = look.model_copy(update={"lighting": named})
    director.set_look(look)
    director.set_subject(settings.subject)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    with contextlib.ExitStack() as cleanup:
        listener = cleanup.enter_context(listen(settings.server))
        tracker = make_tracker(settings)
        source = open_source(settings.source, own_label=settings.output.label)
        cleanup.callback(source.close)
        sink = sink_for(settings.output)
        cleanup.callback(sink.close)
        daemon = Daemon(settings, director, source, sink, tracker)
        cleanup.callback(daemon.stop)
        daemon.start()
        server = serve(create_app(daemon, settings), settings.server, listener=listener)
        cleanup.callback(server.stop)
        leave_to_stay()
        typer.echo(f"Relit Camera runs; the panel is at {server.address.url}")
        if beside is not None:
            cleanup.enter_context(beside(daemon, server.address.url))
        ends_at = time.monotonic() + (math.inf if seconds is None else seconds)
        while not stop.is_set() and (left := ends_at - time.monotonic()) > 0:
            stop.wait(min(left, 0.5))
        daemon.begin_stop()
