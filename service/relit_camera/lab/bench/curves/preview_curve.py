"""Previews against their number of viewers: the product's server and its viewers in one process, over loopback."""

from __future__ import annotations

import selectors
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import cast

from relit_camera.api.app import create_app_without_camera
from relit_camera.api.dependencies import ApiContext
from relit_camera.api.openapi.api_router import API_PREFIX
from relit_camera.api.preview_stream import PreviewBroadcaster
from relit_camera.api.server.http_server import ApiServer, ServerAddress, start_api_server
from relit_camera.base.config.preset_store import PresetStore
from relit_camera.base.config.settings import ServerSettings
from relit_camera.base.errors import RelitError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.lab.bench.curves.cost_curve import CostCurve, one_thread
from relit_camera.lab.bench.mesh_run import MeshRun
from relit_camera.live.camera_control import CameraControl

VIEWER_COUNTS = (1, 2, 4, 8, 16, 32, 64)
FPS = 30.0
WARM_UP_S, FIRST_PICTURE_TIMEOUT_S = 0.7, 20.0
PART_HEAD = b"Content-Type: image/jpeg"
RECEIVED_BYTES = 1 << 18


def preview_curve(
    mesh: MeshRun, picture: DisplayImage, viewer_counts: Sequence[int] = VIEWER_COUNTS, seconds: float = 3.0
) -> CostCurve:
    """The curve of the server's processor time for each published picture, all viewers of one preview.

    Args:
        mesh: the unit; sampled here.
        picture: what is published, 30 times a second, uint8 sRGB (height, width, 3).
        viewer_counts: numbers of viewers.
        seconds: how long each number is measured.

    Raises:
        RelitError: the server does not start, or a viewer gets no picture.
    """
    camera = _StillCamera(picture)
    app = create_app_without_camera()
    control = cast("CameraControl", camera)
    # Presets are not asked for.
    app.state.context = ApiContext(control, PresetStore(Path()), PreviewBroadcaster(control))
    processor_ms, pictures_per_s = list[float](), list[float]()
    with one_thread(), start_api_server(app, ServerSettings(port=0)) as server:
        for count in viewer_counts:
            ms, rate = _measure(server, count, seconds)
            processor_ms.append(ms / FPS)
            pictures_per_s.append(rate)
    mesh.sample()
    height, width = picture.shape[:2]
    return CostCurve(
        "preview-viewers",
        "viewers",
        list(viewer_counts),
        f"Previews of {width} × {height} pixels to all viewers together, a published picture of {FPS:g} a second.",
        mesh.ms,
        {"server": processor_ms},
        other={"pictures a second each": pictures_per_s},
    )


class _StillCamera:
    """What previews ask of a camera: one picture, published anew 30 times a second."""

    def __init__(self, image: DisplayImage) -> None:
        self._image = image

    def picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """See `CameraControl.picture`."""
        wait_s = (after + 1) / FPS - time.monotonic()
        if wait_s > timeout_s:
            time.sleep(timeout_s)
            return None
        time.sleep(max(0.0, wait_s))
        return max(after + 1, int(time.monotonic() * FPS)), self._image

    def stopping(self) -> bool:
        """Whether the camera stops: never."""
        return False


class _Viewers:
    """Viewers of a preview, read by one thread, whose processor time it knows.

    Attributes:
        pictures: that each has got.
        processor_s: of the reading.
    """

    def __init__(self, connections: Sequence[socket.socket]) -> None:
        self.pictures = [0] * len(connections)
        self.processor_s = 0.0
        self._selector = selectors.DefaultSelector()
        self._last = [b""] * len(connections)
        self._ending = threading.Event()
        for index, connection in enumerate(connections):
            self._selector.register(connection, selectors.EVENT_READ, index)
        self._thread = threading.Thread(target=self._read, name="viewers")

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Within the block: read whatever comes."""
        self._thread.start()
        try:
            yield
        finally:
            self._ending.set()
            self._thread.join()
            self._selector.close()

    def _read(self) -> None:
        while not self._ending.is_set():
            for key, _ in self._selector.select(0.1):
                connection, index = cast("socket.socket", key.fileobj), key.data
                got = connection.recv(RECEIVED_BYTES)
                if not got:
                    self._selector.unregister(connection)
                found = self._last[index] + got
                self.pictures[index] += found.count(PART_HEAD)
                self._last[index] = found[1 - len(PART_HEAD) :]
            self.processor_s = time.thread_time()


def _measure(server: ApiServer, count: int, seconds: float) -> tuple[float, float]:
    """Milliseconds of processor time that the server needs in a second, and pictures a second of a viewer."""
    with ExitStack() as opened:
        connections = [opened.enter_context(_connect(server.address)) for _ in range(count)]
        viewers = _Viewers(connections)
        with viewers.reading():
            deadline = time.monotonic() + FIRST_PICTURE_TIMEOUT_S
            while not all(viewers.pictures):
                if time.monotonic() > deadline:
                    raise RelitError(f"{count} viewers have no picture in {FIRST_PICTURE_TIMEOUT_S:g} s", "try again")
                time.sleep(0.02)
            time.sleep(WARM_UP_S)
            began, process_s, reading_s = time.monotonic(), time.process_time(), viewers.processor_s
            before = sum(viewers.pictures)
            time.sleep(seconds)
            lasted_s = time.monotonic() - began
            used_s = time.process_time() - process_s - (viewers.processor_s - reading_s)
            pictures = sum(viewers.pictures) - before
    return 1e3 * used_s / lasted_s, pictures / count / lasted_s


def _connect(address: ServerAddress) -> socket.socket:
    connection = socket.create_connection((address.host, address.port), FIRST_PICTURE_TIMEOUT_S)
    host = f"{address.host}:{address.port}"
    connection.sendall(f"GET {API_PREFIX}/preview.mjpg HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
    return connection
