"""What every route needs, handed to it by FastAPI."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Request

from relit_camera.api.presets import PresetStore
from relit_camera.api.preview import PreviewFeed
from relit_camera.api.problems import NotReadyError
from relit_camera.config.settings import RelitSettings
from relit_camera.stream.control import CameraControl


@dataclass(frozen=True)
class ApiContext:
    """The running camera and what the API keeps beside it.

    Attributes:
        camera: the running camera.
        presets: stored looks.
        preview: pictures for viewers, each encoded once.
        closing: set when the server is to end: long answers must end.
        slow: held by work of a second or so.
    """

    camera: CameraControl
    presets: PresetStore
    preview: PreviewFeed
    closing: threading.Event = field(default_factory=threading.Event)
    slow: threading.Lock = field(default_factory=threading.Lock)

    def ending(self) -> bool:
        """Whether long answers must end now."""
        return self.closing.is_set() or self.camera.stopping()

    @contextmanager
    def slow_work(self) -> Iterator[None]:
        """Around reading, painting and encoding pictures: one at a time, so that the camera keeps its cores.

        Raises:
            NotReadyError: the camera stops: what waited for its turn is not begun any more.
        """
        with self.slow:
            if self.ending():
                raise NotReadyError("the camera is stopping", "start it again")
            yield

    def changed(self, collection: str) -> None:
        """Tell listeners that a stored collection, such as `environments`, has another content."""
        self.camera.events.publish("collection", name=collection)


def make_context(camera: CameraControl, settings: RelitSettings) -> ApiContext:
    """The context of one running camera."""
    return ApiContext(camera, PresetStore(settings.storage.presets), PreviewFeed(camera))


async def context_of(request: Request) -> ApiContext:
    """The context that `create_app` put into the application. Async: else each request would borrow a thread for it."""
    context: ApiContext = request.app.state.context
    return context


Context = Annotated[ApiContext, Depends(context_of)]
"""Annotation of a route's parameter that receives the context."""
