"""Runs the camera with its API and panel until it is told to stop: what `relit run` and `relit demo` start."""

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

import psutil
import typer

from relit_camera.api.server.listener import open_listener
from relit_camera.app.camera_service import CameraService
from relit_camera.app.captures.desk.controls_note import restore_noted_controls
from relit_camera.app.captures.live_capture import require_instant_name
from relit_camera.app.config_reload import apply_edited_settings
from relit_camera.app.first_scene import FirstScene
from relit_camera.app.setup.check_runner import Checks, no_checks
from relit_camera.app.setup.needed_models import missing_models
from relit_camera.app.setup.startup_checks import check_before_devices
from relit_camera.app.systemd import is_being_restarted, notify_systemd
from relit_camera.app.wiring import make_tracker
from relit_camera.base.concurrency.regular_checks import checking_regularly
from relit_camera.base.concurrency.resident_memory import FreedMemoryReturn, large_allocations_apart
from relit_camera.base.concurrency.threads import freeze_gc
from relit_camera.base.config.config_watcher import ConfigWatcher
from relit_camera.base.config.settings import OutputSettings, RelitSettings, SourceSettings
from relit_camera.base.errors import ModelError, RelitError
from relit_camera.devices.keeper.kept_sink import KeeperParts, KeptSink, keeper_for
from relit_camera.devices.keeper.sink_keeper import SinkKeeper
from relit_camera.devices.on_demand.on_demand_source import DemandWatch
from relit_camera.devices.sinks.reopening_sink import ReopeningSink
from relit_camera.devices.sinks.sink import Sink
from relit_camera.devices.sinks.sink_factory import open_sink, published_label
from relit_camera.devices.sources.changeable_source import ChangeableSource
from relit_camera.devices.sources.source import Source
from relit_camera.devices.sources.source_factory import open_source
from relit_camera.face.face_state import Tracker
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.scene.kept_scene import GivenOptions, SceneKeeper
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.subject.subject_store import SubjectStore

log = logging.getLogger(__name__)

INSTANT_SUBJECT = "instant"
"""Name under which the subject that `instant` asks for is stored."""
CompanionTask = Callable[[CameraService, str], AbstractContextManager[None]]
"""Makes a context that is entered while the camera runs, from the camera and the panel's address."""
AWAY_MESSAGE = "the camera is starting"
"""What the placeholder says that the keeper shows when the last picture no longer is."""
SourceOpener = Callable[[SourceSettings, str], Source]
"""Opens the source of the settings, given the label of the virtual camera that must not be taken as source."""


def run_camera(
    settings: RelitSettings,
    environment: str | None = None,
    side_task: CompanionTask | None = None,
    seconds: float | None = None,
    source_for: SourceOpener = lambda settings, own_label: open_source(settings, own_label=own_label),
    sink_for: Callable[[OutputSettings], Sink] = open_sink,
    reload: tuple[Path, Callable[[Path], RelitSettings]] | None = None,
    instant: bool = False,
    strict: bool = False,
    checks: Checks = no_checks,
    given: GivenOptions | None = None,
    first_scene: FirstScene | None = None,
) -> None:
    """Run the camera until SIGTERM or SIGINT, then end within 3 s.

    Names and files in the settings are checked before a device is opened: look, subject, address and token, tracker,
    and what `check_before_devices` lists. Source and sink are checked by opening them. What may come later is waited
    for, with a placeholder in its place: a webcam, a virtual camera, the public models.

    Args:
        settings: of this run.
        environment: a stored environment's name or a panorama file, instead of the one in the settings.
        side_task: entered when the panel can be reached, left before the camera stops.
        seconds: after which the camera stops by itself.
        source_for: opens the source that the settings name.
        sink_for: opens the sink that the settings name.
        reload: the configuration file, to be watched for edits, and the function that reads it.
        instant: capture the person before the camera as subject `INSTANT_SUBJECT` first, and show nothing until then;
            the subject that the settings name is not shown.
        strict: raise for a device or model that is missing, in place of waiting for it.
        checks: what the API answers with to `GET checks`; called in a worker process.
        given: options of the command line, where look and subject are kept from run to run; None keeps nothing.
        first_scene: made with `environment`, `instant` and `given`, where somebody has begun it already.

    Raises:
        RelitError: the port is in use, a file is missing; with `strict`, a device or model …
    """
    opening = contextlib.ExitStack()
    with first_scene or FirstScene(settings, environment, instant, given) as begun:
        opening.enter_context(large_allocations_apart())
        if instant:
            cure = f"show it with --subject {INSTANT_SUBJECT}, or give it another name"
            require_instant_name(SubjectStore(settings.storage.subjects), INSTANT_SUBJECT, cure)
        scene_controller = begun.controller()
    check_before_devices(settings)
    restore_noted_controls(settings.storage.data_dir)
    stop = threading.Event()
    told_to_end = [signal.SIGTERM, signal.SIGINT]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # not under nohup
        told_to_end.append(signal.SIGHUP)
    for number in told_to_end:
        signal.signal(number, lambda *_: stop.set())
    with contextlib.ExitStack() as cleanup:
        cleanup.push(opening)
        listener = cleanup.enter_context(open_listener(settings.server))
        tracker, models_error = _open_tracker(settings, strict)
        sink_keeper = keeper_for(settings.output) if sink_for is open_sink else None
        sink = _open_sink(settings, sink_keeper, scene_controller, sink_for)
        until_owned = cleanup.enter_context(contextlib.ExitStack())
        until_owned.callback(sink.close)
        demand = None
        if settings.source.on_demand:
            demand = DemandWatch(sink)
            cleanup.callback(demand.close)
        source = ChangeableSource(
            settings.source,
            lambda asked: source_for(asked, published_label(settings.output)),
            demand.wanted if demand else None,
            # Whoever allowed one camera's picture as filmed has not seen the other's.
            before_new_source=lambda: scene_controller.set_unlit_allowed(False),
        )
        cleanup.callback(source.close)
        missing = source.opening_error or sink.opening_error
        if strict and missing is not None:
            raise missing
        camera_service = CameraService(
            settings,
            scene_controller,
            source,
            sink,
            tracker,
            partial(make_tracker, settings),
            demand.note_viewer if demand else lambda: None,
            checks=checks,
        )
        if sink_keeper is not None:
            sink_keeper.on_trouble = partial(camera_service.report_degradation, DegradationCode.KEEPER_FAILED)
            if sink_keeper.trouble is not None:
                sink_keeper.on_trouble(sink_keeper.trouble)
        if models_error is not None:
            camera_service.setup.wait_for_models(models_error)
        until_owned.pop_all()  # from here on the camera service closes the sink, unless a driver hangs in it
        cleanup.push(partial(_exit_if_threads_hang, camera_service))
        cleanup.callback(camera_service.stop)
        camera_service.start()
        for waited_for in (source.opening_error, sink.opening_error, models_error):
            if waited_for is not None:
                typer.echo(f"Waiting: {waited_for}", err=True)
        if instant:
            camera_service.instant_capture.start(INSTANT_SUBJECT, until_done=True)
        # The web framework is loaded while the first picture is made.
        from relit_camera.api.app import create_app
        from relit_camera.api.server.http_server import start_api_server

        server = start_api_server(create_app(camera_service, settings), settings.server, listener=listener)
        cleanup.callback(server.stop)
        freeze_gc()
        opening.close()
        typer.echo(f"Relit Camera runs; the panel is at {server.address.url}")
        if side_task is not None:
            cleanup.enter_context(side_task(camera_service, server.address.url))
        if given is not None:
            keeper = SceneKeeper(scene_controller, settings, given)
            cleanup.enter_context(checking_regularly("scene-keeper", keeper.check, at_end=True))
        memory = FreedMemoryReturn(lambda: psutil.Process().memory_info().rss)
        cleanup.enter_context(checking_regularly("memory", memory.check))
        if reload is not None:
            apply, report_degradation = (
                partial(apply_edited_settings, scene_controller, settings),
                partial(camera_service.report_degradation, DegradationCode.CONFIGURATION_FAILED),
            )
            watcher = ConfigWatcher(*reload, settings, apply, report_degradation)
            cleanup.enter_context(checking_regularly("config", watcher.check))
        cleanup.enter_context(notify_systemd(camera_service.status))
        ends_at = time.monotonic() + (math.inf if seconds is None else seconds)
        while not stop.is_set() and (left := ends_at - time.monotonic()) > 0:
            stop.wait(min(left, 0.5))
        camera_service.request_stop()
        if sink_keeper is not None:
            sink_keeper.hands_over = is_being_restarted()


def _open_sink(
    settings: RelitSettings,
    keeper: SinkKeeper | None,
    scene_controller: SceneController,
    sink_for: Callable[[OutputSettings], Sink],
) -> ReopeningSink:
    """The sink that the settings name, whose virtual camera a keeper holds if there is one."""
    output = settings.output
    open_directly = partial(sink_for, output)
    parts = KeeperParts(
        placeholder=lambda size: placeholder(size, AWAY_MESSAGE, output.placeholder),
        may_repeat=lambda: not scene_controller.scene.unlit_allowed,
    )
    opener: Callable[[], Sink] = open_directly if keeper is None else partial(KeptSink, keeper, parts, open_directly)
    return ReopeningSink(opener, (output.width, output.height))


def _open_tracker(settings: RelitSettings, strict: bool) -> tuple[Tracker | None, ModelError | None]:
    """The tracker that the settings name; or none, and the error, where public models are missing that can be pulled.

    Raises:
        RelitError: it cannot be opened for another reason; with `strict`, for that one too.
    """
    try:
        return make_tracker(settings), None
    except ModelError as error:
        if strict or not missing_models(settings.tracker.name):
            raise
        return None, error


def _exit_if_threads_hang(
    camera_service: CameraService, kind: type[BaseException] | None, error: BaseException | None, _: object
) -> None:
    """End the process at once if a thread hangs in a driver or network: the interpreter would wait for it for ever."""
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
