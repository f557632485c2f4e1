"""What every route needs, handed to it by FastAPI."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request

from relit_camera.api.preview_stream import PreviewBroadcaster
from relit_camera.base.config.preset_store import PresetStore
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import NotReadyError
from relit_camera.live.camera_control import CameraControl


@dataclass(frozen=True)
class ApiContext:
    """The running camera and what the API keeps beside it.

    Attributes:
        camera: the running camera.
        presets: stored looks.
        preview: pictures for viewers, each encoded once.
        closing: set when the server is to end: long answers must end.
        image_work_lock: held by work of a second or so.
    """

    camera: CameraControl
    presets: PresetStore
    preview: PreviewBroadcaster
    closing: threading.Event = field(default_factory=threading.Event)
    image_work_lock: threading.Lock = field(default_factory=threading.Lock)

    def is_stopping(self) -> bool:
        """Whether long answers must end now."""
        return self.closing.is_set() or self.camera.stopping()

    @contextmanager
    def exclusive_image_work(self) -> Iterator[None]:
        """Around reading, painting and encoding pictures: one at a time, so that the camera keeps its cores.

        Raises:
            NotReadyError: the camera stops: what waited for its turn is not begun any more.
        """
        with self.image_work_lock:
            if self.is_stopping():
                raise NotReadyError("the camera is stopping", "start it again")
            yield

    def publish_collection_changed(self, collection: str) -> None:
        """Tell listeners that a stored collection, such as `environments`, has another content."""
        self.camera.events.publish("collection", name=collection)


def create_context(camera: CameraControl, settings: RelitSettings) -> ApiContext:
    """The context of one running camera."""
    return ApiContext(camera, PresetStore(settings.storage.presets), PreviewBroadcaster(camera))


async def get_context(request: Request) -> ApiContext:
    """The context that `create_app` put into the application. Async: else each request would borrow a thread for it."""
    context: ApiContext = request.app.state.context
    return context


ApiContextDep = Annotated[ApiContext, Depends(get_context)]
"""Annotation of a route's parameter that receives the context."""
