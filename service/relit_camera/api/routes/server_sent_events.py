"""The route of server-sent events: changes of the scene, the status every second, and the camera's own events."""

from __future__ import annotations

import asyncio
import queue
import time
from collections.abc import AsyncIterator

from pydantic_core import to_json
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.responses import StreamingResponse

from relit_camera.api.bodies.schemas import SceneBody
from relit_camera.api.dependencies import ApiContext, ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.event_hub import Event

router = api_router("status")

SCENE_POLL_S = 0.05
STATUS_INTERVAL_S = 1.0
HEARTBEAT_INTERVAL_S = 15
RECONNECT_DELAY_MS = 1000


@router.get(
    "/events",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "Events without end, until the listener leaves or the camera stops. `scene`: what is shown, "
            "whole, at once and after each change. `status`: as GET /api/v1/status, at once and every second. "
            "`collection`: a stored collection, its `name`, has another content. Others as the camera tells them.",
            "content": {"text/event-stream": {"schema": {"type": "string"}}},
        }
    },
)
async def get_events(api: ApiContextDep) -> EventSourceResponse:
    """What happens, as it happens, for an `EventSource`."""
    return EventSourceResponse(event_stream(api), ping=HEARTBEAT_INTERVAL_S)


async def event_stream(api: ApiContext) -> AsyncIterator[ServerSentEvent]:
    """Events for one listener.

    The scene is polled: so every change counts, whoever made it, and a slow listener gets the newest scene only.
    """
    with api.camera.events.listen() as queued:
        revision, status_due = None, 0.0
        while not api.is_stopping():
            scene = api.camera.scene_controller.scene
            if scene.revision != revision:
                revision = scene.revision
                yield _server_sent_event("scene", scene_body(scene))
            while (event := _next_event(queued)) is not None:
                yield _server_sent_event(event.kind, {**event.data, "at": event.at})
            if time.monotonic() >= status_due:
                status_due = time.monotonic() + STATUS_INTERVAL_S
                yield _server_sent_event("status", api.camera.status())
            await asyncio.sleep(SCENE_POLL_S)


def scene_body(scene: Scene) -> SceneBody:
    """The scene as clients see it."""
    look = scene.look
    return SceneBody(
        revision=scene.revision,
        lighting=look.lighting,
        background=look.background,
        mode=look.mode,
        subject=scene.subject_name,
        rung=scene.subject.metadata.rung if scene.subject else None,
        unlit_allowed=scene.unlit_allowed,
        avatar_allowed=scene.avatar_allowed,
        frozen=scene.frozen,
        can_undo=scene.can_undo,
        can_redo=scene.can_redo,
    )


def _next_event(queued: queue.Queue[Event]) -> Event | None:
    try:
        return queued.get_nowait()
    except queue.Empty:
        return None


def _server_sent_event(kind: str, data: object) -> ServerSentEvent:
    # Not json.dumps: NaN and infinity become null, as in the other answers.
    return ServerSentEvent(to_json(data, inf_nan_mode="null").decode(), event=kind, retry=RECONNECT_DELAY_MS)
