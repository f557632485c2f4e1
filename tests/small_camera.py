"""A whole camera, small and fast: a generated subject, a made-up face, pictures from memory, a sink that remembers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import numpy as np

from relit_camera.api.app import create_app
from relit_camera.api.server.http_server import start_api_server
from relit_camera.app.camera_service import DEFAULT_TIMINGS, CameraService, CameraTimings
from relit_camera.base.config.look import Lighting, Look, Mode
from relit_camera.base.config.settings import Fallback, OutputSettings, RelitSettings, ServerSettings, StorageSettings
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.devices.sinks.sink import NullSink
from relit_camera.devices.sources.playback_source import PlaybackSource, TimedImage
from relit_camera.devices.sources.source import Source, SourceInfo
from relit_camera.face.face_state import FaceState, Tracker
from relit_camera.face.identity.face_embedder import FaceEmbedder
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme
from relit_camera.lab.bench.synthetic_tracker import SyntheticTracker
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.supervision.pipeline_health import HealthLimits
from relit_camera.subject.subject import Subject
from tests.generated_subject import small_subject

SIZE = (128, 96)
FPS = 20.0
WAIT_S = 60.0
"""Long enough for a slow machine that has much else to do."""
PATIENT = CameraTimings(stale_after_s=WAIT_S, pipeline=HealthLimits(hang_timeout_s=WAIT_S, abandon_timeout_s=WAIT_S))
"""With these nothing that only has to wait for a processor looks like a fault."""


class SteadyTracker(SyntheticTracker):
    """Sees the same face in every frame, so that only the light changes a picture."""

    def track(self, frame: Frame) -> FaceState:
        return super().track(Frame(frame.image, frame.index, frame.captured_at, 0.0))


class Embedder(FaceEmbedder):
    """Whoever is before the camera is `distance` from the subject."""

    def __init__(self, distance: float) -> None:
        self.distance, self.looks = distance, 0

    def embed(self, image: np.ndarray, landmarks: np.ndarray, scheme: LandmarkScheme) -> np.ndarray:
        self.looks += 1
        return np.eye(1, 128, dtype=np.float32)[0] * np.float32(self.distance)

    def reference_embedding(self, subject: Subject) -> np.ndarray:
        return np.zeros(128, np.float32)


def grey(value: int = 120, size: tuple[int, int] = SIZE) -> DisplayImage:
    return np.full((size[1], size[0], 3), value, np.uint8)


def memory_source(picture: DisplayImage | None = None, count: int | None = None) -> Source:
    """Gives a picture `FPS` times a second, for ever or `count` times."""
    shown = grey() if picture is None else picture

    def play() -> Iterator[TimedImage]:
        index = 0
        while count is None or index < count:
            yield shown, index / FPS
            index += 1

    return PlaybackSource(SourceInfo("still", "memory", SIZE, FPS), play())


@dataclass
class RememberingSink(NullSink):
    """Keeps every picture that is new.

    Attributes:
        new: the pictures without repetitions, oldest first.
    """

    new: list[DisplayImage] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(SIZE)

    def write(self, image: DisplayImage) -> None:
        if not self.new or self.new[-1] is not image:
            self.new.append(image)
        super().write(image)

    def wait_for(self, count: int) -> None:
        """Wait until so many new pictures came since the start."""
        wait_until(lambda: len(self.new) >= count)


@dataclass(frozen=True)
class Camera:
    """A running camera and a client of its API."""

    camera_service: CameraService
    scene_controller: SceneController
    sink: RememberingSink
    http: httpx.Client

    def put(self, path: str, **body: object) -> None:
        """Change something; the answer must be good."""
        answer = self.http.put(path, json=body)
        assert answer.status_code == 200, answer.text

    def status(self) -> dict[str, object]:
        """What the camera says of itself."""
        found: dict[str, object] = self.http.get("status").raise_for_status().json()
        return found

    def degraded(self) -> set[DegradationCode]:
        """The codes of all that works less well than asked.

        But for the detail that a busy machine costs, and what comes of the matting model, which tests do without.
        """
        return {degradation.code for degradation in self._degradations()}

    def troubles(self) -> str:
        """The same as one text."""
        return "\n".join(f"{t.what}: {t.why}; {t.cure}" for t in self._degradations())

    def _degradations(self) -> list[Degradation]:
        degraded = self.camera_service.status().degraded
        expected = (DegradationCode.REDUCED_QUALITY, DegradationCode.ROOM_NOT_PARTED)
        return [each for each in degraded if each.code not in expected]


@contextmanager
def running_camera(
    folder: Path,
    source: Source | None = None,
    tracker: Tracker | None = None,
    subject: Subject | str | None = None,
    look: Look | None = None,
    sink: RememberingSink | None = None,
    new_tracker: Callable[[], Tracker] | None = None,
    fallback: Fallback = Fallback.PLACEHOLDER,
    on_viewer: Callable[[], None] = lambda: None,
    timings: CameraTimings = DEFAULT_TIMINGS,
    unlit_allowed: bool = False,
) -> Iterator[Camera]:
    """Run a camera with its API on a real port; `folder` is for what it stores.

    It shows `subject`, which may be a name that the settings could have, or the generated one.
    """
    settings = RelitSettings(
        output=OutputSettings(sink="null", width=SIZE[0], height=SIZE[1], fps=FPS, fallback=fallback),
        server=ServerSettings(port=0),
        storage=StorageSettings(data_dir=folder),
    )
    scene_controller = SceneController(settings.storage)
    scene_controller.set_unlit_allowed(unlit_allowed)
    scene_controller.set_look(look or Look(mode=Mode.PORTRAIT, lighting=Lighting(transition_s=0)))
    if isinstance(subject, str):
        scene_controller.load_configured_subject(subject)
    else:
        scene_controller.show_subject("small", subject or small_subject())
    sink, tracker = sink or RememberingSink(), tracker or SteadyTracker()
    camera_service = CameraService(
        settings, scene_controller, source or memory_source(), sink, tracker, new_tracker, on_viewer, timings
    )
    camera_service.start()
    try:
        with (
            start_api_server(create_app(camera_service, settings), settings.server) as server,
            httpx.Client(base_url=f"{server.address.url}api/v1/", timeout=WAIT_S) as http,
        ):
            yield Camera(camera_service, scene_controller, sink, http)
    finally:
        camera_service.stop()


def wait_until(condition: Callable[[], bool], timeout_s: float = WAIT_S) -> None:
    """Wait for a condition. One that takes long to ask for, over HTTP say, is asked for less often.

    Raises:
        AssertionError: it did not come about in time.
    """
    deadline = time.monotonic() + timeout_s
    while True:
        asked_at = time.monotonic()
        if condition():
            return
        now = time.monotonic()
        assert now < deadline, "it did not come about in time"
        time.sleep(min(max(0.01, 4 * (now - asked_at)), 0.1))


def difference(a: DisplayImage, b: DisplayImage) -> float:
    """Mean absolute difference of two uint8 pictures, code values."""
    return float(np.abs(a.astype(np.float32) - b).mean())
