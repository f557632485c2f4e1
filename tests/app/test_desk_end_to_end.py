"""A desk capture from the page's first word to the stored subject: screen, webcam and person are simulated, no more.

The bundled person sits before a screen that shows what the page was told. The webcam's picture follows from that and
from the controls that the camera sets. The networks find the face, and the worker process makes the subject.
"""

from __future__ import annotations

import threading
import time
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from relit_camera.app.captures.desk.controls_note import ControlsNote
from relit_camera.app.captures.desk.desk_filming import DeskFilming, FilmingTimings
from relit_camera.base.array_types import Float32Array
from relit_camera.base.config.look import Look, Mode
from relit_camera.base.config.settings import StorageSettings
from relit_camera.base.images.color import luminance, srgb_encode
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.desk.desk_session import SessionTimings
from relit_camera.lab.evaluate.desk_simulation import MONITOR, SimulatedFrames, SimulatedWebcam
from relit_camera.lab.evaluate.ladder.desk_rung import SCHEME
from relit_camera.light.directions import texel_directions
from relit_camera.live.frame_recorder import FrameRecorder
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.desk_status import DeskPlace, DeskStage
from relit_camera.live.status.event_hub import EventHub
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.subject_file import read_subject
from tests.app.desk_builders import SMALL_PX, write_small_subject
from tests.capture.desk.bundled_person import bundled_person
from tests.capture.instant.conftest import models, pulled_models
from tests.devices.test_webcam_controls import FakeWebcam
from tests.small_camera import wait_until

__all__ = ["models", "pulled_models"]

NOSE_TIP = 1
"""Of the scheme `mesh478`."""
PLACE = DeskPlace(MONITOR.screen.width_cm, MONITOR.screen.height_cm, MONITOR.distance_cm, MONITOR.camera.up_cm)
TIMINGS = FilmingTimings(
    session=SessionTimings(
        frames_a_step=4, settling_s=0.1, min_step_s=0.15, page_timeout_s=5.0, show_timeout_s=30.0, step_timeout_s=30.0
    ),
    automatic_s=0.5,
    delay_frames=2,
    frame_timeout_s=10.0,
)
FULL_LIGHT_CODE = 150
"""Brightness of the webcam's controls at which white has the light that `SimulatedFrames` exposes well."""


@dataclass
class Desk:
    """Screen, webcam and person, each a thread or a formula.

    Attributes:
        frames: the person before the screen.
        webcam: whose controls decide how bright its pictures are.
        shown: the light of each patch that the screen shows.
    """

    frames: SimulatedFrames
    webcam: FakeWebcam = field(default_factory=FakeWebcam)
    shown: Float32Array = field(default_factory=lambda: np.zeros(MONITOR.patches.count, np.float32))

    def picture(self, random: np.random.Generator) -> DisplayImage:
        """What the webcam sees now."""
        linear = self.frames.linear(self.shown, RigidTransform(0, *random.normal(0, 0.3, 2)))
        if self.webcam.values == FakeWebcam().values:  # exposure is automatic
            linear *= 0.8 / max(float(np.percentile(linear, 99.5)), 1e-6)
        else:
            linear *= self.webcam.brightness() / FULL_LIGHT_CODE
        codes = 255 * srgb_encode(np.maximum(linear, 0)) + random.normal(0, 2, linear.shape)
        return np.asarray(np.clip(np.rint(codes), 0, 255), np.uint8)


def person_at_the_desk() -> SimulatedFrames:
    """The bundled person before the screen in a room with a little light."""
    person = bundled_person()
    lights = np.zeros((0, MONITOR.patches.count), np.float32)
    pictures = person.patch_pictures(MONITOR)
    return SimulatedFrames(person, pictures, lights, SimulatedWebcam(size=(480, 360), room=0.5), None, MONITOR)


@pytest.mark.slow
def test_a_person_before_their_screen_becomes_a_subject(tmp_path: Path, models: Path) -> None:
    desk, stop = Desk(person_at_the_desk()), threading.Event()
    scenes = SceneController(StorageSettings(data_dir=tmp_path))
    scenes.set_look(Look(mode=Mode.PORTRAIT))
    recorder = FrameRecorder()
    before = dict(desk.webcam.values)
    filming = DeskFilming(
        recorder,
        scenes,
        EventHub(),
        write_small_subject,
        lambda: nullcontext(desk.webcam),
        ControlsNote(tmp_path, lambda: "fake webcam"),
        lambda: 1 / 20,
        timings=TIMINGS,
    )

    def page() -> None:
        shown = -1
        while not stop.wait(0.02):
            status = filming.page_shows(shown)
            if status.stage.needs_page:
                desk.shown, shown = np.array(status.patches, np.float32) ** np.float32(2.2), status.step

    def webcam() -> None:
        random, index = np.random.default_rng(0), 0
        while not stop.is_set():
            if filming.status().stage is DeskStage.BUILDING:
                stop.wait(0.1)  # nobody looks; a picture takes the time of a core
                continue
            captured_at = time.monotonic()  # a webcam's picture takes a moment, this one up to half a second
            recorder.offer(Frame(desk.picture(random), index, captured_at, index / 20))
            index += 1

    threads = [threading.Thread(target=work) for work in (page, webcam)]
    for thread in threads:
        thread.start()
    try:
        filming.start("me", PLACE)
        wait_until(lambda: not filming.status().stage.is_running, 250)
    finally:
        stop.set()
        for thread in threads:
            thread.join()
    status = filming.status()
    assert status.stage is DeskStage.DONE, status
    assert desk.webcam.values == before
    assert scenes.scene.subject_name == "me"
    assert scenes.scene.look.mode is Mode.LIVE
    found = read_subject(scenes.subject_path("me"))
    assert (found.metadata.rung, found.metadata.lights) == ("desk", MONITOR.patches.count)
    assert (found.metadata.width, found.metadata.height) == (SMALL_PX, SMALL_PX)
    assert 0 < (found.metadata.measured_fraction or 0) < 0.2
    right, left = (np.zeros((32, 64, 3), np.float32) for _ in range(2))
    right[texel_directions()[..., 0] > 0.8] = left[texel_directions()[..., 0] < -0.8] = 1
    lit = luminance(BasisRelighter(found).relight(np.stack([right, left])))
    nose = found.landmarks[SCHEME][NOSE_TIP]
    cheek = np.s_[int(nose[1]) - 5 : int(nose[1]) + 5, int(nose[0]) + 10 : int(nose[0]) + 22]
    assert lit[0][cheek].mean() > 3 * lit[1][cheek].mean(), "the right cheek is lit from the right"
