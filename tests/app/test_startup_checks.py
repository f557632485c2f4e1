"""What is wrong with the settings is found before a device is opened."""

from __future__ import annotations

import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from relit_camera.app.camera_service import CameraService
from relit_camera.app.run_camera import run_camera
from relit_camera.app.setup.startup_checks import check_before_devices
from relit_camera.app.wiring import make_pipeline
from relit_camera.base.config.settings import OutputSettings, RelitSettings, SourceSettings, StorageSettings
from relit_camera.base.errors import ConfigError, DeviceError, ModelError, RelitError, VideoError
from relit_camera.devices.on_demand import on_demand_source
from relit_camera.devices.sinks.sink import NullSink, Sink
from relit_camera.devices.sources.source import Source
from relit_camera.face import matting
from relit_camera.face.matte_files import write_mattes
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import DegradationCode
from tests.cli.relit_command import Material, write_material
from tests.small_camera import SteadyTracker, memory_source, wait_until

PLUGINS = Path(__file__).parents[1] / "plugins"
"""Where the example package is, some plug-ins of which fail."""


@pytest.fixture(scope="module")
def material(tmp_path_factory: pytest.TempPathFactory) -> Material:
    return write_material(tmp_path_factory.mktemp("material"), frames=2)


@pytest.fixture(autouse=True)
def signal_handlers() -> Iterator[None]:
    """`run_camera` sets handlers of the whole process."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


class Devices:
    """Records what is opened; the source then fails, so that no camera runs."""

    def __init__(self) -> None:
        self.opened: list[str] = []

    def source(self, settings: SourceSettings, own_label: str) -> Source:
        self.opened.append("source")
        raise VideoError("the source was reached", "this is the end of the test")

    def sink(self, settings: OutputSettings) -> Sink:
        self.opened.append("sink")
        return NullSink((settings.width, settings.height))


def run(material: Material, folder: Path, devices: Devices, changes: dict[str, Any], **more: Any) -> None:
    values: dict[str, Any] = {
        "storage": {"data_dir": folder / "data"},
        "server": {"port": 0},
        "subject": str(material.subject),
        "tracker": {"name": material.tracker},
    }
    settings = RelitSettings(**(values | changes))
    run_camera(settings, source_for=devices.source, sink_for=devices.sink, **more)


def test_sound_settings_reach_the_devices(material: Material, tmp_path: Path) -> None:
    devices = Devices()
    with pytest.raises(VideoError, match="the source was reached"):
        run(material, tmp_path, devices, {})
    assert devices.opened == ["sink", "source"]


def test_instant_shows_neither_the_configured_subject_nor_the_unlit_picture(
    material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[SceneController] = []

    def make(storage: StorageSettings) -> SceneController:
        made.append(SceneController(storage))
        return made[-1]

    monkeypatch.setattr("relit_camera.app.first_scene.SceneController", make)
    with pytest.raises(VideoError, match="the source was reached"):
        run(material, tmp_path, Devices(), {}, instant=True)
    assert made[0].scene.subject is None
    assert not made[0].scene.unlit_allowed


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"output": {"placeholder": "none.png"}}, r"none\.png"),
        ({"output": {"placeholder": __file__}}, "not a picture format"),
        ({"matte": "recorded:none.npz"}, r"none\.npz"),
        ({"matte": f"recorded:{__file__}"}, "holds no recorded mattes"),
        ({"matte": "magic"}, "no matte is called 'magic'"),
        ({"tracker": {"name": "magic"}}, "no tracker .*'magic'"),
        ({"relight": {"name": "magic"}}, "no relighter .*'magic'"),
        ({"reenact": {"name": "magic"}}, "no reenactor .*'magic'"),
        ({"relight": {"name": "basis:3"}}, "relighter basis takes no argument, and got '3'; name it 'basis'"),
        ({"reenact": {"name": "first-order:7"}}, "reenactor first-order takes no argument, and got '7'"),
        ({"relight": {"name": "broken"}}, "relighter 'broken' of the package relit-example-plugin cannot be loaded"),
        ({"reenact": {"name": "broken"}}, "reenactor 'broken' of the package relit-example-plugin cannot be loaded"),
        ({"tracker": {"name": "raising"}}, "tracker 'raising' of the package relit-example-plugin cannot be opened"),
        (
            {"inference": {"provider": "openvino", "strict": True}, "relight": {"name": "onnx-basis"}},
            "cannot run on openvino: the installed ONNX Runtime was built without it; `relit doctor` says how",
        ),
        ({"tracker": {"name": "recorded:none.json"}}, r"none\.json"),
        ({"reenact": {"name": "onnx:none.onnx"}}, r"none\.onnx does not exist"),
        ({"reenact": {"model": "none.onnx"}}, r"none\.onnx does not exist"),
        ({"subject": "nobody"}, "no subject 'nobody'"),
        ({"subject": __file__}, "subject"),
        ({"look": {"lighting": {"environment": "nowhere"}}}, "no environment 'nowhere'"),
        ({"look": {"background": {"kind": "image", "image": "nowhere"}}}, "no background picture 'nowhere'"),
        ({"server": {"host": "0.0.0.0", "port": 0}}, "there is no token"),
    ],
)
def test_faults_are_found_before_a_device_is_opened(
    changes: dict[str, Any], words: str, material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(PLUGINS)
    devices = Devices()
    with pytest.raises(RelitError, match=words):
        run(material, tmp_path, devices, changes)
    assert devices.opened == []


def no_device(*_: object) -> Any:
    raise DeviceError("there is no such device", "plug one in")


@pytest.mark.parametrize("missing", ["source_for", "sink_for"])
def test_a_missing_device_is_an_error_only_if_that_is_asked_for(
    missing: str, material: Material, tmp_path: Path
) -> None:
    devices: dict[str, Any] = {"source_for": lambda *_: memory_source(), "sink_for": Devices().sink, missing: no_device}
    settings = RelitSettings(
        storage=StorageSettings(data_dir=tmp_path / "data"),
        server={"port": 0},
        subject=str(material.subject),
        tracker={"name": material.tracker},
    )
    with pytest.raises(DeviceError, match="there is no such device; plug one in"):
        run_camera(settings, strict=True, **devices)
    seen: list[str] = []

    @contextmanager
    def watch(camera_service: CameraService, url: str) -> Iterator[None]:
        code = DegradationCode.SOURCE_FAILED if missing == "source_for" else DegradationCode.SINK_FAILED
        wait_until(lambda: any(found.code is code for found in camera_service.status().degraded))
        seen.extend(f"{found.why}; {found.cure}" for found in camera_service.status().degraded if found.code is code)
        yield

    run_camera(settings, side_task=watch, seconds=0.1, **devices)
    assert seen == ["there is no such device; plug one in"]


def test_missing_models_are_an_error_only_if_that_is_asked_for(
    material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "no-models"))
    with pytest.raises(ModelError, match="relit models pull"):
        run(material, tmp_path, Devices(), {"tracker": {"name": "mesh"}}, strict=True)
    devices = Devices()
    with pytest.raises(VideoError, match="the source was reached"):
        run(material, tmp_path, devices, {"tracker": {"name": "mesh"}})


@pytest.mark.parametrize("system", ["darwin", "win32"])
def test_on_demand_where_no_system_tells_the_readers_is_found_before_a_device_is_opened(
    system: str, material: Material, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices = Devices()
    monkeypatch.setattr(on_demand_source, "sys", SimpleNamespace(platform=system))
    with pytest.raises(ConfigError, match="only Linux tells who reads a virtual camera; leave it out"):
        run(material, tmp_path, devices, {"source": {"on_demand": True}})
    assert devices.opened == []
    with pytest.raises(VideoError, match="the source was reached"):  # a file and `null` need nobody to tell
        run(material, tmp_path, devices, {"source": {"on_demand": True}, "output": {"sink": "null"}})


def test_recorded_mattes_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Path] = []
    real = matting.RecordedMatting

    def note(path: Path) -> matting.RecordedMatting:
        read.append(path)
        return real(path)

    monkeypatch.setattr(matting, "RecordedMatting", note)
    write_mattes(tmp_path / "mattes.npz", [np.ones((4, 4), np.float32)])
    settings = RelitSettings(matte=f"recorded:{tmp_path / 'mattes.npz'}")
    check_before_devices(settings)
    for _ in range(2):  # another worker's as well
        make_pipeline(settings, SteadyTracker(), (160, 90))
    assert read == [tmp_path / "mattes.npz"]


def test_a_panorama_file_that_is_missing_is_found_before_a_device_is_opened(material: Material, tmp_path: Path) -> None:
    devices = Devices()
    with pytest.raises(RelitError, match=r"no panorama at none\.hdr"):
        run(material, tmp_path, devices, {}, environment="none.hdr")
    assert devices.opened == []


def test_a_port_in_use_is_found_before_a_device_is_opened(material: Material, tmp_path: Path) -> None:
    devices = Devices()
    with socket.create_server(("127.0.0.1", 0)) as other, pytest.raises(RelitError, match="is in use"):
        run(material, tmp_path, devices, {"server": {"port": other.getsockname()[1]}})
    assert devices.opened == []
