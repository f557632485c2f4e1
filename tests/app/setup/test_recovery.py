"""A whole camera that starts without webcam, virtual camera or models shows a placeholder, and recovers by itself."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from relit_camera.app.camera_service import CameraService
from relit_camera.app.setup import camera_setup
from relit_camera.base.config.look import Lighting, Look, Mode
from relit_camera.base.config.settings import OutputSettings, RelitSettings, SourceSettings, StorageSettings
from relit_camera.base.errors import ModelError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.device_discovery import list_webcams
from relit_camera.devices.sinks.reopening_sink import ReopeningSink
from relit_camera.devices.sinks.virtual_camera_sink import VirtualCameraSink
from relit_camera.devices.sources.changeable_source import ChangeableSource
from relit_camera.devices.sources.webcam_source import WebcamSource
from relit_camera.face.face_state import Tracker
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import DegradationCode
from tests.devices.fake_devices import FakeCapture, FakeTree
from tests.generated_subject import small_subject
from tests.small_camera import FPS, PATIENT, SIZE, WAIT_S, SteadyTracker, difference, wait_until


class Output:
    """An open virtual camera that keeps the last picture."""

    def __init__(self, node: str) -> None:
        self.node, self.size = node, SIZE
        self.last: DisplayImage | None = None

    def send(self, image: DisplayImage) -> None:
        self.last = image

    def close(self) -> None:
        pass


class BareMachine:
    """A machine without webcam, kernel module and models, and a camera that runs on it.

    Attributes:
        outputs: the virtual cameras that were opened.
        has_models: whether the tracker's models are there.
    """

    def __init__(self, folder: Path, has_models: bool = True) -> None:
        self.tree = FakeTree(folder / "machine")
        self.outputs: list[Output] = []
        self.has_models = has_models
        self.settings = RelitSettings(
            source=SourceSettings(width=SIZE[0], height=SIZE[1], fps=FPS),
            output=OutputSettings(width=SIZE[0], height=SIZE[1], fps=FPS),
            storage=StorageSettings(data_dir=folder / "data"),
        )
        scene_controller = SceneController(self.settings.storage)
        scene_controller.set_look(Look(lighting=Lighting(transition_s=0)))
        scene_controller.show_subject("small", small_subject())
        self.source = ChangeableSource(
            self.settings.source, self._webcam, before_new_source=lambda: scene_controller.set_unlit_allowed(False)
        )
        self.sink = ReopeningSink(self._virtual_camera, SIZE)
        tracker = SteadyTracker() if has_models else None
        self.camera = CameraService(
            self.settings, scene_controller, self.source, self.sink, tracker, self._tracker, timings=PATIENT
        )

    def _webcam(self, asked: SourceSettings) -> WebcamSource:
        capture = FakeCapture(size=SIZE, interval_s=1 / FPS)
        return WebcamSource(asked.source, SIZE, FPS, tree=self.tree, open_capture=lambda *_: capture)

    def _virtual_camera(self) -> VirtualCameraSink:
        def opened(size: tuple[int, int], fps: float, node: str) -> Output:
            self.outputs.append(Output(node))
            return self.outputs[-1]

        return VirtualCameraSink(SIZE, FPS, tree=self.tree, open_output=opened)

    def _tracker(self) -> Tracker:
        if not self.has_models:
            raise ModelError("model face_mesh is not pulled", "run `relit models pull face_mesh`")
        return SteadyTracker()

    def told(self) -> dict[DegradationCode, str]:
        """What works less well than asked, but for what a busy machine does, and without the matting model."""
        return {
            found.code: f"{found.why}; {found.cure}"
            for found in self.camera.status().degraded
            if found.code not in (DegradationCode.REDUCED_QUALITY, DegradationCode.ROOM_NOT_PARTED)
        }

    def shown(self) -> DisplayImage:
        found = self.camera.picture(0, WAIT_S)
        assert found is not None
        return found[1]

    @contextmanager
    def running(self) -> Iterator[None]:
        self.camera.start()
        try:
            yield
        finally:
            self.camera.stop()


WAITING = placeholder(SIZE, "waiting for the camera")


@pytest.mark.slow
def test_a_webcam_that_is_plugged_in_later_and_a_module_that_is_loaded_later(tmp_path: Path) -> None:
    machine = BareMachine(tmp_path)
    with machine.running():
        wait_until(lambda: {DegradationCode.SOURCE_FAILED, DegradationCode.SINK_FAILED} <= machine.told().keys())
        assert machine.told()[DegradationCode.SOURCE_FAILED].startswith("there is no webcam; plug one in")
        assert "sudo modprobe v4l2loopback" in machine.told()[DegradationCode.SINK_FAILED]
        wait_until(lambda: difference(machine.shown(), WAITING) == 0)
        assert machine.camera.status().readers.count is None

        machine.tree.add_loopback(10, "Relit Camera")
        wait_until(lambda: DegradationCode.SINK_FAILED not in machine.told())
        wait_until(lambda: bool(machine.outputs) and machine.outputs[-1].last is not None)
        assert machine.camera.status().sink == f"camera {machine.tree.dev / 'video10'}"

        machine.tree.add_webcam(0, "Cam")
        wait_until(lambda: str(machine.camera.status().state) == "live")
        assert machine.told() == {}
        wait_until(lambda: machine.camera.status().fps.new > 0)
        assert difference(machine.shown(), WAITING) > 1


@pytest.mark.slow
def test_models_that_are_pulled_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = BareMachine(tmp_path, has_models=False)
    monkeypatch.setattr(
        camera_setup, "missing_models", lambda tracker, matte="": [] if machine.has_models else ["face_mesh"]
    )
    machine.tree.add_webcam(0, "Cam")
    machine.tree.add_loopback(10, "Relit Camera")
    with machine.running():
        machine.camera.setup.wait_for_models(ModelError("model face_mesh is not pulled", "run `relit models pull`"))
        wait_until(lambda: str(machine.camera.status().state) == "standing-in")
        assert machine.told() == {
            DegradationCode.MODELS_MISSING: "model face_mesh is not pulled; run `relit models pull`"
        }
        machine.has_models = True
        wait_until(lambda: str(machine.camera.status().state) == "live")
        assert machine.told() == {}
        assert machine.camera.status().tracker.name == "nodding"


def test_smaller_pictures_are_published_in_the_size_of_the_virtual_camera(tmp_path: Path) -> None:
    machine = BareMachine(tmp_path)
    machine.tree.add_webcam(0, "Cam")
    machine.tree.add_loopback(10, "Relit Camera")
    with machine.running():
        wait_until(lambda: str(machine.camera.status().state) == "live")
        wait_until(lambda: difference(machine.shown(), WAITING) > 5)
        before = machine.shown()
        machine.camera.setup.change_source(width=SIZE[0] // 2, height=SIZE[1] // 2)
        # The same person, with less detail.
        wait_until(lambda: 0 < difference(machine.shown(), before) < 12)
        assert machine.told() == {}
        assert machine.shown().shape == before.shape
        output = machine.outputs[-1].last
        assert output is not None
        assert output.shape == before.shape


@pytest.mark.slow
def test_whoever_allowed_one_webcam_s_picture_as_filmed_has_not_allowed_another_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    machine = BareMachine(tmp_path)
    monkeypatch.setattr(camera_setup, "list_webcams", lambda tree: list_webcams(machine.tree))
    machine.tree.add_webcam(0, "Cam", by_id="one")
    machine.tree.add_webcam(2, "Other", usb="1-3:1.0", by_id="two")
    machine.tree.add_loopback(10, "Relit Camera")
    scene_controller = machine.camera.scene_controller
    with machine.running():
        wait_until(lambda: str(machine.camera.status().state) == "live")
        as_filmed = Look(mode=Mode.LIVE, lighting=Lighting(split=1, transition_s=0))
        scene_controller.change(lambda _: as_filmed, unlit_allowed=True)
        wait_until(lambda: machine.camera.status().unlit)
        machine.camera.setup.change_source(width=SIZE[0] // 2, height=SIZE[1] // 2)
        assert scene_controller.scene.unlit_allowed  # the same webcam
        machine.camera.setup.change_source(device="two")
        wait_until(lambda: not scene_controller.scene.unlit_allowed)
        assert scene_controller.scene.look.lighting.split == 0
        wait_until(lambda: not machine.camera.status().unlit)
