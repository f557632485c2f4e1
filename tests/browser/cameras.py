"""Cameras for the browser to look at: real ones in processes of their own, and one whose every state a test sets."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np
import pytest

from relit_camera.api.app import create_app
from relit_camera.api.server.http_server import start_api_server
from relit_camera.app.demo import demo_files
from relit_camera.base.config.settings import RelitSettings, ServerSettings, StorageSettings
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.models.model_store import FOLDER_VARIABLE
from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.status.setup_status import Check
from relit_camera.subject.subject_file import write_subject
from tests.api.fake_camera import FakeCamera
from tests.app.subject_builders import captured
from tests.cli.relit_command import environment, start
from tests.doctor.fake_host import FakeMachine
from tests.small_camera import wait_until

ROOT = Path(__file__).resolve().parents[2]
SUBJECT = "ada"
START_S = 60.0
"""Until a camera's first picture, on a machine with much else to do."""


@dataclass
class Api:
    """A client of a running camera.

    Attributes:
        url: the panel's address.
        http: of the API.
    """

    url: str
    http: httpx.Client

    def get(self, path: str) -> Any:
        """The JSON at a path below /api/v1."""
        return self.http.get(path).raise_for_status().json()

    def patch(self, path: str, **body: object) -> Any:
        return self.http.patch(path, json=body).raise_for_status().json()

    def put(self, path: str, **body: object) -> Any:
        return self.http.put(path, json=body).raise_for_status().json()

    def published(self) -> DisplayImage:
        """The newest published picture: uint8 RGB (height, width, 3)."""
        data = self.http.get("snapshot.jpg").raise_for_status().content
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB)
        assert picture is not None
        return picture.astype(np.uint8)

    def wait_for(self, path: str, **values: object) -> None:
        """Wait until these members of the JSON at a path have these values."""
        wait_until(lambda: values.items() <= self.get(path).items(), START_S)

    def runs_on(self, seconds: float) -> None:
        """Wait until the camera has run for some seconds more by its own clock."""
        until_s = self.get("status")["uptime_s"] + seconds
        wait_until(lambda: self.get("status")["uptime_s"] >= until_s, START_S)


class FakeServer(Api):
    """A camera without devices: its scene is real, its pictures and status are what a test makes them.

    Attributes:
        camera: it.
        data: the folder of what it stores.
    """

    def __init__(self, camera: FakeCamera, settings: RelitSettings) -> None:
        self.camera, self.data, self._settings = camera, settings.storage.data_dir, settings
        self._server = start_api_server(create_app(camera, settings), ServerSettings(port=0))
        url = self._server.address.url
        super().__init__(url, httpx.Client(base_url=f"{url}api/v1/", timeout=START_S))

    def stop_server(self) -> None:
        """End the server: pages find nobody at their address."""
        self._server.stop()

    def start_server(self) -> None:
        """Serve again at the same address, as a camera that was started anew."""
        same = ServerSettings(port=self._server.address.port)
        self._server = start_api_server(create_app(self.camera, self._settings), same)

    def show_raw_picture(self) -> None:
        """Publish the webcam's own picture, as somebody has asked for who has no subject."""
        self.patch("scene", subject=None, unlit_allowed=True)
        self.camera.base = replace(self.camera.base, unlit=True)

    def show_to_another(self) -> None:
        """Let somebody else be before the camera than the subject, whose portrait is hidden from them."""
        self.patch("scene", mode="portrait")
        other = Degradation("a placeholder is shown", "somebody else", code=DegradationCode.OTHER_PERSON)
        self.camera.degraded = [other]

    def show_checks(self, *checks: Check) -> None:
        """Let these be what the camera's checks find."""
        self.camera.setup.checks = lambda: checks  # type: ignore[method-assign]

    def tell_film(self) -> None:
        """Send the event that tells how far the capture from a film is."""
        self.camera.events.publish("film-capture", **asdict(self.camera.film_capture.status()))


@contextmanager
def fake_server(data: Path, subject: str | None = SUBJECT) -> Iterator[FakeServer]:
    """Serve a fake camera that stores in folder `data`; it shows `subject`, a grey face, or nobody."""
    camera = FakeCamera(data)
    if subject is not None:
        write_subject(camera.scene_controller.subjects.new_path(subject), captured("film"))
        camera.scene_controller.choose_stored_subject(subject)
        camera.scene_controller.mark_start()
    server = FakeServer(camera, RelitSettings(storage=StorageSettings(data_dir=data)))
    with server.http:
        try:
            yield server
        finally:
            camera.stop()
            server.stop_server()


@dataclass
class StagedCamera(Api):
    """A real camera on a machine whose devices come and go."""

    machine: FakeMachine


@dataclass
class ProcessCamera(Api):
    """A real camera: `relit demo` or `relit run` in a process of its own."""

    process: subprocess.Popen[str]


@contextmanager
def camera_process(
    folder: Path, *arguments: object, models: Path | None = None, settings: str = ""
) -> Iterator[ProcessCamera]:
    """Run `relit ARGUMENTS` on a free port, small and without a virtual camera.

    Args:
        folder: of what it stores: the same again is a restart.
        arguments: command and options, without the port.
        models: folder of the public networks; none if not given.
        settings: lines of YAML that are added to its settings.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "settings.yaml"
    path.write_text("output: {sink: 'null', width: 640, height: 360, fps: 24}\n" + settings, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER_VARIABLE, str(models or folder / "no models"))
        process = start("--config", path, *arguments, "--port", 0, folder=folder)
    with _running(process) as (url, http):
        yield ProcessCamera(url, http, process)


def camera_on_clip(folder: Path) -> AbstractContextManager[ProcessCamera]:
    """`relit run` on the bundled clip, which stands for a webcam, with its recorded track."""
    return camera_process(folder, "run", "--source", demo_files.CLIP, "--tracker", f"recorded:{demo_files.TRACK}")


@contextmanager
def staged_camera(folder: Path, models: Path, settings: str = "") -> Iterator[StagedCamera]:
    """Run the camera on a machine without any device; `StagedCamera.machine` is plugged and loaded into.

    Args:
        folder: of the machine, and of what the camera stores.
        models: folder of the public networks.
        settings: lines of YAML that are added to its settings.
    """
    machine = FakeMachine(folder / "machine")
    path = folder / "settings.yaml"
    lines = ["server: {port: 0}", "output: {width: 640, height: 360, fps: 24}", "source: {source: webcam}", settings]
    path.write_text("\n".join(lines), encoding="utf-8")
    command = [sys.executable, "-m", "tests.browser.staged_machine", str(machine.root), str(path)]
    variables = environment(folder) | {FOLDER_VARIABLE: str(models)}
    process = subprocess.Popen(
        command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT
    )
    with _running(process) as (url, http):
        yield StagedCamera(url, http, machine)


@contextmanager
def _running(process: subprocess.Popen[str]) -> Iterator[tuple[str, httpx.Client]]:
    """The panel's address of a camera that was started, and a client of its API; it is ended with the block."""
    assert process.stdout is not None
    try:
        line = next((line for line in process.stdout if "the panel is at" in line), "")
        assert line, process.stderr and process.stderr.read()
        url = line.split()[-1]
        with httpx.Client(base_url=f"{url}api/v1/", timeout=START_S) as http:
            yield url, http
    finally:
        process.terminate()
        try:
            process.communicate(timeout=START_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()
