"""Running the camera with its API: shared by `relit run` and everything like it."""

from __future__ import annotations

import contextlib
import logging
import math
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import typer

from relit_camera.api.app import create_app
from relit_camera.api.server import listen, serve
from relit_camera.cli.service_manager import announced
from relit_camera.config.look import Look, Settings
from relit_camera.config.settings import OutputSettings, RelitSettings
from relit_camera.config.watch import watch_config
from relit_camera.cores import leave_to_stay, share_cores
from relit_camera.errors import ConfigError, RelitError
from relit_camera.files import sweep_unfinished
from relit_camera.stream.assembly import make_tracker
from relit_camera.stream.daemon import Daemon
from relit_camera.stream.demand.on_demand import OnDemand
from relit_camera.stream.director import Director
from relit_camera.stream.sinks.base import Sink
from relit_camera.stream.sinks.factory import open_sink, published_label
from relit_camera.stream.sources.factory import open_source

log = logging.getLogger(__name__)

Beside = Callable[[Daemon, str], AbstractContextManager[None]]
"""What else goes on while the camera runs, given the camera and the panel's address."""


def run_camera(
    settings: RelitSettings,
    environment: str | None = None,
    beside: Beside | None = None,
    seconds: float | None = None,
    sink_for: Callable[[OutputSettings], Sink] = open_sink,
    reload: tuple[Path, Callable[[Path], RelitSettings]] | None = None,
) -> None:
    """Run the camera until SIGTERM or SIGINT, then end within 3 s.

    Everything that can be wrong with the settings is found before a device is touched.

    Args:
        settings: of this run.
        environment: a stored environment's name or a panorama file, in place of the settings' own.
        beside: entered when the panel can be reached, left when the camera is about to end.
        seconds: end by itself after so long.
        sink_for: opens what the settings name.
        reload: the configuration file, which is watched, and what reads it anew.

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
        make_source = partial(open_source, settings.source, own_label=published_label(settings.output))
        source = make_source()
        cleanup.callback(source.close)
        sink = sink_for(settings.output)
        unowned = cleanup.enter_context(contextlib.ExitStack())
        unowned.callback(sink.close)
        new_tracker = partial(make_tracker, settings)
        if settings.source.on_demand:
            demand = OnDemand(source, make_source, sink)
            cleanup.callback(demand.close)
            daemon = Daemon(settings, director, demand.source, sink, tracker, new_tracker, demand.note_viewer)
        else:
            daemon = Daemon(settings, director, source, sink, tracker, new_tracker)
        unowned.pop_all()  # the daemon closes it, where closing does not hang
        cleanup.push(partial(_leave_what_hangs, daemon))
        cleanup.callback(daemon.stop)
        daemon.start()
        server = serve(create_app(daemon, settings), settings.server, listener=listener)
        cleanup.callback(server.stop)
        leave_to_stay()
        typer.echo(f"Relit Camera runs; the panel is at {server.address.url}")
        if beside is not None:
            cleanup.enter_context(beside(daemon, server.address.url))
        if reload is not None:
            apply, tell = partial(_apply, director, settings), partial(daemon.tell, "configuration")
            cleanup.enter_context(watch_config(*reload, settings, apply, tell))
        cleanup.enter_context(announced(daemon.status))
        ends_at = time.monotonic() + (math.inf if seconds is None else seconds)
        while not stop.is_set() and (left := ends_at - time.monotonic()) > 0:
            stop.wait(min(left, 0.5))
        daemon.begin_stop()


def _apply(
    director: Director, started: RelitSettings, before: RelitSettings, after: RelitSettings
) -> ConfigError | None:
    """Show what was edited of the configuration's look and subject; returns what a person should know.

    Raises:
        RelitError: something of it is not there; then nothing is changed.
    """
    if after.subject is None and before.subject is not None and "subject" not in after.model_fields_set:
        # Else an edit that lost a line would show the live picture, room and all.
        raise ConfigError("it no longer names the subject", "name one, or write 'subject: null' for the live picture")
    chosen = director.subjects.resolve(after.subject) if after.subject not in (None, before.subject) else None
    if after.look != before.look:
        director.update_look(partial(_edited, before=before.look, after=after.look))
    if chosen is not None:
        director.show_subject(*chosen)
    elif after.subject is None and before.subject is not None:
        director.set_subject(None)
    fixed = [name for name in RelitSettings.model_fields if name not in ("look", "subject")]
    later = [name for name in fixed if getattr(after, name) != getattr(started, name)]
    return ConfigError(f"what changed of {', '.join(later)} counts from the next start", "restart") if later else None


def _edited(look: Look, before: Look, after: Look) -> Look:
    """`look` with what differs between `before` and `after`; of the lighting, those values alone."""
    lighting = look.lighting.model_copy(update=_changes(before.lighting, after.lighting))
    parts = _changes(before, after)
    return look.model_copy(update=parts | {"lighting": lighting})


def _changes(before: Settings, after: Settings) -> dict[str, Any]:
    values = {name: getattr(after, name) for name in type(after).model_fields}
    return {name: value for name, value in values.items() if value != getattr(before, name)}


def _leave_what_hangs(daemon: Daemon, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
    """End the process here if a driver or a network still hangs: the interpreter would wait for its thread."""
    if not daemon.left_behind:
        return
    log.warning("left behind: %s", ", ".join(daemon.left_behind))
    if isinstance(error, RelitError):
        print(f"relit: {error}", file=sys.stderr)
    elif error is not None:
        traceback.print_exception(error)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(1 if error else 0)
