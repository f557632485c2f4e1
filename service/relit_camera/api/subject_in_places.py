"""Small pictures of the person who is shown, lit by one place or another: what the panel's tiles show."""

from __future__ import annotations

import os
import sys
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from hashlib import sha256

import numpy as np

from relit_camera.base.concurrency.resident_memory import large_allocations_apart
from relit_camera.base.config.look import EnvironmentBackground, Lighting, Look
from relit_camera.base.images.image_files import encode_display
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.live.compositing.background_renderer import BackgroundRenderer
from relit_camera.live.compositing.compositor import composite_source_image
from relit_camera.live.reenactment.rest_layer import RestLayer
from relit_camera.live.scene.light_transition import display_light
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.relighting.shared_relighters import made_relighter
from relit_camera.subject.subject import Subject

SIZE = (256, 192)
"""Width and height in pixels."""
MOST_KEPT = 64
"""Pictures that are kept of one subject: about a megabyte."""
NICENESS = 10


class SubjectInPlaces:
    """Makes the pictures one at a time, in a thread of low priority, and keeps them while the subject stays."""

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(1, "place-pictures", _lower_priority)
        self._lock = threading.Lock()
        self._waiting = 0
        # From here on: only in that thread.
        self._subject: Callable[[], Subject | None] = lambda: None
        """A weak reference: a subject that is shown no more may be large."""
        self._made: dict[str, tuple[bytes, bytes]] = {}
        """The digest of the light, and the JPEG file, by the environment's name: the environment itself is large."""
        self._renderer: _SubjectRenderer | None = None

    def jpeg(self, subject: Subject, name: str, load: Callable[[], Environment]) -> Future[bytes]:
        """The JPEG file, 256 x 192 pixels, of a subject in the environment `name`, that `load` gives.

        The future raises what `load` raises.
        """
        with self._lock:
            self._waiting += 1
        return self._executor.submit(self._jpeg, subject, name, load)

    def _jpeg(self, subject: Subject, name: str, load: Callable[[], Environment]) -> bytes:
        try:
            with large_allocations_apart(tidied=False):
                return self._kept_or_made(subject, name, load)
        finally:
            with self._lock:
                self._waiting -= 1
                if not self._waiting:
                    self._renderer = None  # as large as the subject; nobody waits for more

    def _kept_or_made(self, subject: Subject, name: str, load: Callable[[], Environment]) -> bytes:
        environment = load()
        if subject is not self._subject():
            self._subject, self._renderer = weakref.ref(subject), None
            self._made.clear()
        found, light = self._made.pop(name, None), sha256(environment.light_map.tobytes()).digest()
        if found is None or found[0] != light:
            if self._renderer is None:
                self._renderer = _SubjectRenderer(subject)
            found = light, encode_display(self._renderer.picture(environment))
        self._made[name] = found
        if len(self._made) > MOST_KEPT:
            del self._made[next(iter(self._made))]
        return found[1]


class _SubjectRenderer:
    """Relights one subject at rest, before each place that lights it."""

    def __init__(self, subject: Subject) -> None:
        # Not for others: this thread has a low priority, and they would wait for it.
        self._relighter = made_relighter(subject) or BasisRelighter(subject)
        subject.drop_pages()
        self._at_rest = RestLayer(subject, SIZE)
        self._gain = np.float32(subject.metadata.display_gain)

    def picture(self, environment: Environment) -> np.ndarray:
        """The person in that place: uint8 sRGB RGB (192, 256, 3)."""
        scene = Scene(Look(lighting=Lighting(), background=EnvironmentBackground()), environment)
        light = display_light(environment, scene.look.lighting) * self._gain
        layer = self._at_rest.render(self._relighter.relight(light[None])[0])
        return composite_source_image(BackgroundRenderer(SIZE), layer, scene, 0.0)


def _lower_priority() -> None:
    if sys.platform == "linux":  # a thread there has a priority of its own
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICENESS)
