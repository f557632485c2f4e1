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
from relit_camera.api.server.http_server import open_listener, start_api_server
from relit_camera.app.camera_service import CameraService
from relit_camera.app.systemd import notify_systemd
from relit_camera.app.wiring import make_tracker
from relit_camera.base.config.config_watcher import watch_config
from relit_camera.base.config.look import Look, SettingsModel
from relit_camera.base.config.settings import OutputSettings, RelitSettings
from relit_camera.base.errors import ConfigError, RelitError
from relit_camera.base.storage import remove_unfinished_files
from relit_camera.base.threads import freeze_gc, limit_threads
from relit_camera.devices.on_demand.on_demand_source import OnDemandController
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sinks.sink_factory import open_sink, published_label
from relit_camera.devices.sources.source_factory import open_source
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import DegradationCode

log = logging.getLogger(__name__)

SideTask = Callable[[CameraService, str], AbstractContextManager[None]]
"""What else goes on while the camera runs, given the camera and the panel's address."""


def run_camera(
    settings: RelitSettings,
    environment: str | None = None,
    side_task: SideTask | None = None,
    seconds: float | None = None,
    sink_for: Callable[[OutputSettings], Sink] = open_sink,
    reload: tuple[Path, Callable[[Path], RelitSettings]] | None = None,
) -> None:
    """Run the camera until SIGTERM or SIGINT, then end within 3 s.

    Everything that can be wrong with the settings is found before a device is touched.

    Args:
        settings: of this run.
        environment: a stored environment's name or a panorama file, in place of the settings' own.
        side_task: entered when the panel can be reached, left when the camera is about to end.
        seconds: end by itself after so long.
        sink_for: opens what the settings name.
        reload: the configuration file, which is watched, and what reads it anew.

    Raises:
        RelitError: the port is in use, a file, device or model is missing …
    """
    limit_threads()
    for folder in settings.storage.folders:
        remove_unfinished_files(folder)  # what an earlier run left where it was killed
    look, scene_controller = settings.look, SceneController(settings.storage)
    if environment is not None:
        named = look.lighting.model_copy(
            update={"environment": scene_controller.register_temporary_environment(environment)}
        )
        look = look.model_copy(update={"lighting": named})
    scene_controller.set_look(look)
    scene_controller.set_subject(settings.subject)
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    with contextlib.ExitStack() as cleanup:
        listener = cleanup.enter_context(open_listener(settings.server))
        tracker = make_tracker(settings)
        make_source = partial(open_source, settings.source, own_label=published_label(settings.output))
        source = make_source()
        cleanup.callback(source.close)
        sink = sink_for(settings.output)
        unowned = cleanup.enter_context(contextlib.ExitStack())
        unowned.callback(sink.close)
        new_tracker = partial(make_tracker, settings)
        if settings.source.on_demand:
            demand = OnDemandController(source, make_source, sink)
            cleanup.callback(demand.close)
            camera_service = CameraService(
                settings, scene_controller, demand.source, sink, tracker, new_tracker, demand.note_viewer
            )
        else:
            camera_service = CameraService(settings, scene_controller, source, sink, tracker, new_tracker)
        unowned.pop_all()  # the camera service closes it, unless closing would hang
        cleanup.push(partial(_exit_if_threads_hang, camera_service))
        cleanup.callback(camera_service.stop)
        camera_service.start()
        server = start_api_server(create_app(camera_service, settings), settings.server, listener=listener)
        cleanup.callback(server.stop)
        freeze_gc()
        typer.echo(f"Relit Camera runs; the panel is at {server.address.url}")
        if side_task is not None:
            cleanup.enter_context(side_task(camera_service, server.address.url))
        if reload is not None:
            apply, report_degradation = (
                partial(_apply_reload, scene_controller, settings),
                partial(camera_service.report_degradation, DegradationCode.CONFIGURATION_FAILED),
            )
            cleanup.enter_context(watch_config(*reload, settings, apply, report_degradation))
        cleanup.enter_context(notify_systemd(camera_service.status))
        ends_at = time.monotonic() + (math.inf if seconds is None else seconds)
        while not stop.is_set() and (left := ends_at - time.monotonic()) > 0:
            stop.wait(min(left, 0.5))
        camera_service.request_stop()


def _apply_reload(
    scene_controller: SceneController, started: RelitSettings, before: RelitSettings, after: RelitSettings
) -> ConfigError | None:
    """Show what was edited of the configuration's look and subject; returns what a person should know.

    Raises:
        RelitError: something of it is not there; then nothing is changed.
    """
    if after.subject is None and before.subject is not None and "subject" not in after.model_fields_set:
        # Else an edit that lost a line would show the live picture, room and all.
        raise ConfigError("it no longer names the subject", "name one, or write 'subject: null' for the live picture")
    chosen = scene_controller.subjects.resolve(after.subject) if after.subject not in (None, before.subject) else None
    if after.look != before.look:
        scene_controller.update_look(partial(_merge_edits, before=before.look, after=after.look))
    if chosen is not None:
        scene_controller.show_subject(*chosen)
    elif after.subject is None and before.subject is not None:
        scene_controller.set_subject(None)
    fixed = [name for name in RelitSettings.model_fields if name not in ("look", "subject")]
    later = [name for name in fixed if getattr(after, name) != getattr(started, name)]
    return ConfigError(f"what changed of {', '.join(later)} counts from the next start", "restart") if later else None


def _merge_edits(look: Look, before: Look, after: Look) -> Look:
    """`look` with what differs between `before` and `after`; of the lighting, those values alone."""
    lighting = look.lighting.model_copy(update=_changed_fields(before.lighting, after.lighting))
    parts = _changed_fields(before, after)
    return look.model_copy(update=parts | {"lighting": lighting})


def _changed_fields(before: SettingsModel, after: SettingsModel) -> dict[str, Any]:
    values = {name: getattr(after, name) for name in type(after).model_fields}
    return {name: value for name, value in values.items() if value != getattr(before, name)}


def _exit_if_threads_hang(
    camera_service: CameraService, kind: type[BaseException] | None, error: BaseException | None, _: object
) -> None:
    """End the process here if a driver or a network still hangs: the interpreter would wait for its thread."""
    if not camera_service.hung_threads:
        return
    log.warning("left behind: %s", ", ".join(camera_service.hung_threads))
    if isinstance(error, RelitError):
        print(f"relit: {error}", file=sys.stderr)
    elif error is not None:
        traceback.print_exception(error)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(1 if error else 0)
