"""The context that FastAPI passes to every route function: the camera, and what the API keeps beside it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request

from relit_camera.api.preview_stream import PreviewBroadcaster
from relit_camera.api.subject_in_places import SubjectInPlaces
from relit_camera.base.config.preset_store import PresetStore
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import NotReadyError
from relit_camera.live.camera_control import CameraControl

MAX_IMAGE_WORK = 24
"""Requests that work on pictures or wait to. The server has 40 threads for all requests: while a file is decoded, which
may take half a minute, those that change the scene find a free one."""


@dataclass(frozen=True)
class ApiContext:
    """The running camera and the API's own state.

    Attributes:
        camera: the running camera.
        presets: stored looks.
        preview: pictures for viewers, each encoded once.
        subject_in_places: pictures of the subject in the environments.
        closing: set when the server shuts down: endless answers must end.
        image_work_lock: held while a picture is read, drawn or encoded.
        image_work_places: one is taken by each request that does so or waits for it.
    """

    camera: CameraControl
    presets: PresetStore
    preview: PreviewBroadcaster
    subject_in_places: SubjectInPlaces = field(default_factory=SubjectInPlaces)
    closing: threading.Event = field(default_factory=threading.Event)
    image_work_lock: threading.Lock = field(default_factory=threading.Lock)
    image_work_places: threading.Semaphore = field(default_factory=lambda: threading.BoundedSemaphore(MAX_IMAGE_WORK))

    def is_stopping(self) -> bool:
        """Whether endless answers must end now."""
        return self.closing.is_set() or self.camera.stopping()

    @contextmanager
    def exclusive_image_work(self) -> Iterator[None]:
        """Do the block's work on pictures alone: one at a time, so that the camera keeps its cores.

        Only `subject_in_places` works beside it, in its one thread of low priority, for which nobody should wait.

        Raises:
            NotReadyError: the camera is stopping, or `MAX_IMAGE_WORK` others work or wait.
        """
        if not self.image_work_places.acquire(blocking=False):
            raise NotReadyError(f"{MAX_IMAGE_WORK} other requests work on pictures", "try again in a few seconds")
        try:
            with self.image_work_lock:
                self.require_running()
                yield
        finally:
            self.image_work_places.release()

    def require_running(self) -> None:
        """Raise NotReadyError where the camera is stopping."""
        if self.is_stopping():
            raise NotReadyError("the camera is stopping", "start it again")

    def publish_collection_changed(self, collection: str) -> None:
        """Send an event that the content of a stored collection, such as `environments`, has changed."""
        self.camera.events.publish("collection", name=collection)


def create_context(camera: CameraControl, settings: RelitSettings) -> ApiContext:
    """The context of one running camera."""
    return ApiContext(camera, PresetStore(settings.storage.presets), PreviewBroadcaster(camera))


async def get_context(request: Request) -> ApiContext:
    """The context that `create_app` put into the application.

    It is async, since FastAPI would run a plain function in a thread, for each request.
    """
    context: ApiContext = request.app.state.context
    return context


ApiContextDep = Annotated[ApiContext, Depends(get_context)]
"""Annotation of a route's parameter that receives the context."""
