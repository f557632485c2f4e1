"""Random changes through the API of a running camera: what a person might do in a day, done in minutes.

Light, places, backgrounds, modes, faces, source, tracker, uploads, previews, steps back and forth. Which ones, and in
which order, is decided by a seed.
"""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import cv2
import httpx
import numpy as np

from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES

STORED = ("one", "two", "three")
"""Names under which places, backgrounds and faces are stored and deleted."""
EXPECTED = {200, 201, 202, 204, 404, 409, 412, 422, 503}
"""A name that is not stored at the moment, what is in use, a source that is being changed: refused, and no fault."""
PREVIEW_S = 2.0


class RandomChanges:
    """Makes changes in a thread, and on demand brings the camera back to one scene, in which memory is compared.

    Attributes:
        made: how many of each kind were made.
        faults: answers that no change may get.
    """

    def __init__(self, address: str, subject_file: Path, seed: int, per_second: float, settle_s: float) -> None:
        """Store what the changes need.

        Args:
            address: of the panel, ending in a slash.
            subject_file: a second person.
            seed: of the random numbers.
            per_second: changes.
            settle_s: how long to wait before something is measured: models are opened meanwhile.
        """
        self.made: Counter[str] = Counter()
        self.faults: list[str] = []
        self._api = f"{address}api/v1/"
        self._random, self._pause_s, self._settle_s = random.Random(seed), 1 / per_second, settle_s
        self._changing = threading.Lock()
        self._subject = subject_file.read_bytes()
        self._previews: list[threading.Thread] = []
        self._http = httpx.Client(base_url=self._api, timeout=120)
        self._reference = self._http.get("scene").raise_for_status().json()
        self._source = self._http.get("source").raise_for_status().json()
        self._trackers = self._http.get("tracker").raise_for_status().json()
        for name in STORED:
            self._upload(name, "environments")
        self._post("subjects", STORED[0], self._subject, "me.relit")
        self._kinds: list[tuple[Callable[[], None], int]] = [
            (self._light, 30), (self._place, 12), (self._background, 12), (self._mode, 8), (self._face, 8),
            (self._take_from, 3), (self._size, 3), (self._tracker, 1), (self._new_upload, 6), (self._deletion, 4),
            (self._pictures, 6), (self._preview, 6), (self._steps, 5), (self._freeze, 3), (self._status, 6),
        ]  # fmt: skip

    def run(self, stopping: threading.Event) -> None:
        """Change one thing after another until told to stop."""
        kinds, weights = zip(*self._kinds, strict=True)
        while not stopping.wait(self._pause_s):
            (kind,) = self._random.choices(kinds, weights)
            with self._changing:
                if stopping.is_set():
                    break
                self.made[kind.__name__.strip("_")] += 1
                try:
                    kind()
                except httpx.TransportError as error:
                    if not stopping.is_set():
                        self.faults.append(f"{kind.__name__}: {error!r}")
                        stopping.wait(1)

    def close(self) -> None:
        """Close the connection, and wait for the previews."""
        for preview in self._previews:
            preview.join()
        self._http.close()

    def at_rest(self, measure: Callable[[], None]) -> None:
        """Call `measure` while nothing is changed, in the scene of the start."""
        with self._changing:
            for preview in self._previews:
                preview.join()
            self._previews.clear()
            names = ("lighting", "background", "mode", "subject", "frozen")
            self._send("PATCH", "scene", json={name: self._reference[name] for name in names})
            self._send("PUT", "tracker", json={"name": self._trackers["name"]})
            wanted = {name: self._source[name] for name in ("device", "width", "height")}
            self._send("PATCH", "source", json={**wanted, "device": Path(wanted["device"]).name})
            time.sleep(self._settle_s)
            measure()

    def _send(self, method: str, path: str, **request: object) -> httpx.Response:
        answer = self._http.request(method, path, **request)  # type: ignore[arg-type]
        if answer.status_code not in EXPECTED:
            self.faults.append(f"{method} {path}: {answer.status_code} {answer.text[:200]}")
        return answer

    def _post(self, collection: str, name: str, data: bytes, file: str) -> None:
        self._send("POST", collection, data={"name": name}, files={"file": (file, data)})

    def _upload(self, name: str, collection: str) -> None:
        if collection == "subjects":
            self._post(collection, name, self._subject, "me.relit")
        elif collection == "environments":
            height = self._random.choice((128, 256, 512, 1024))
            noise = np.random.default_rng(self._random.randrange(1000)).uniform(0.1, 2, (height // 8, height // 4, 3))
            panorama = cv2.resize(noise.astype(np.float32), (2 * height, height), interpolation=cv2.INTER_CUBIC)
            self._post(collection, name, bytes(cv2.imencode(".hdr", np.maximum(panorama, 0))[1]), "place.hdr")
        else:
            side = self._random.choice((640, 1280, 2560))
            picture = np.full((side * 9 // 16, side, 3), self._random.randrange(256), np.uint8)
            self._post(collection, f"{name} picture", bytes(cv2.imencode(".jpg", picture)[1]), "picture.jpg")

    def _light(self) -> None:
        number = self._random.uniform
        lamps = [
            {"azimuth_deg": number(-180, 180), "intensity": number(0, 2)} for _ in range(self._random.randrange(4))
        ]
        changes = {
            "yaw_deg": number(-180, 180),
            "exposure_ev": number(-1, 1),
            "saturation": number(0, 2),
            "lamps": lamps,
            "blend": number(0.2, 1),
            "transition_s": self._random.choice((0, 0.4, 2)),
        }
        self._send("PATCH", "lighting", json=dict(self._random.sample(sorted(changes.items()), 2)))

    def _place(self) -> None:
        self._send("PATCH", "lighting", json={"environment": self._random.choice((*BUILTIN_NAMES, *STORED))})

    def _background(self) -> None:
        pictures = (*STORED, *(f"{name} picture" for name in STORED), "party")
        kinds = (
            {"kind": "none"},
            {"kind": "blur", "strength": self._random.uniform(0.1, 1)},
            {"kind": "color", "color": f"#{self._random.randrange(1 << 24):06x}"},
            {
                "kind": "image",
                "image": self._random.choice(pictures),
            },
            {"kind": "environment", "height_deg": self._random.uniform(30, 90), "blur": self._random.choice((0, 0.3))},
        )
        self._send("PUT", "background", json=self._random.choice(kinds))

    def _mode(self) -> None:
        self._send("PUT", "mode", json={"mode": self._random.choice(("live", "portrait"))})

    def _face(self) -> None:
        self._send("PUT", "subject", json={"name": self._random.choice((self._reference["subject"], *STORED, None))})

    def _take_from(self) -> None:
        device = self._random.choice(("pattern", Path(self._source["device"]).name))
        self._send("PATCH", "source", json={"device": device})

    def _size(self) -> None:
        part = self._random.choice((1, 0.75, 0.5))
        width, height = (2 * round(part * self._source[name] / 2) for name in ("width", "height"))
        self._send("PATCH", "source", json={"width": max(64, width), "height": max(64, height)})

    def _tracker(self) -> None:
        self._send("PUT", "tracker", json={"name": self._random.choice(self._trackers["names"])})

    def _new_upload(self) -> None:
        name, collection = self._random.choice(STORED), self._random.choice(("environments", "backgrounds", "subjects"))
        self._upload(name, collection)

    def _deletion(self) -> None:
        name, collection = self._random.choice(STORED), self._random.choice(("environments", "backgrounds", "subjects"))
        self._send("DELETE", f"{collection}/{name}{' picture' if collection == 'backgrounds' else ''}")

    def _pictures(self) -> None:
        name = self._random.choice((*BUILTIN_NAMES, *STORED))
        for path in (f"environments/{name}/thumbnail.jpg", f"environments/{name}/on-me.jpg", "snapshot.jpg"):
            self._send("GET", path)

    def _preview(self) -> None:
        """Open a preview beside the changes; it closes by itself."""
        wanted = {
            "width": self._random.choice((160, 320, 640)),
            "mirror": self._random.random() < 0.5,
            "before": self._random.random() < 0.3,
        }
        thread = threading.Thread(target=self._look, args=(wanted,))
        thread.start()
        self._previews = [each for each in self._previews if each.is_alive()] + [thread]

    def _look(self, wanted: dict[str, object]) -> None:
        until = time.monotonic() + PREVIEW_S
        try:
            with httpx.stream("GET", f"{self._api}preview.mjpg", params=wanted, timeout=30) as answer:  # type: ignore[arg-type]
                for _ in answer.iter_raw():
                    if time.monotonic() > until:
                        break
        except httpx.HTTPError:
            return  # the camera has ended: the changes say so

    def _steps(self) -> None:
        self._send("POST", self._random.choice(("scene/undo", "scene/undo", "scene/redo", "scene/reset")))

    def _freeze(self) -> None:
        for frozen in (True, False):
            self._send("PUT", "freeze", json={"frozen": frozen})

    def _status(self) -> None:
        for path in ("status", "environments", "subjects", "devices", "source"):
            self._send("GET", path)
