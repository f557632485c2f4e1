"""Routes of the published picture: a snapshot, and a preview as motion JPEG, as published or as filmed."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import suppress
from typing import Annotated, Any

from fastapi import Query
from starlette.responses import Response, StreamingResponse

from relit_camera.api.dependencies import ApiContext, ApiContextDep
from relit_camera.api.jpeg_responses import JPEG_RESPONSE
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.preview_stream import FRAME_WAIT_S, PreviewVariant
from relit_camera.api.problem_details import error_responses
from relit_camera.base.errors import NotReadyError
from relit_camera.base.images.image_files import encode_display

router = api_router("preview")

MULTIPART_BOUNDARY = "picture"
FIRST_FRAME_TIMEOUT_S = 2.0
STREAM_RESPONSE: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "JPEG pictures without end, until the viewer leaves or the camera stops",
        "content": {f"multipart/x-mixed-replace; boundary={MULTIPART_BOUNDARY}": {"schema": {"type": "string"}}},
    }
}

Width = Annotated[int | None, Query(ge=64, le=8192, description="Scaled down to this width; as published if not given")]
Mirror = Annotated[bool, Query(description="Left and right exchanged, as in a mirror")]
Fps = Annotated[float, Query(ge=0.1, le=60, allow_inf_nan=False, description="At most so many pictures a second")]
Before = Annotated[bool, Query(description="The frames as filmed instead: to compare, in this answer only")]


@router.get("/snapshot.jpg", response_class=Response, responses=JPEG_RESPONSE | error_responses(422, 503))
def get_snapshot(api: ApiContextDep) -> Response:
    """The newest published picture, full size."""
    published = api.camera.picture(-1, FIRST_FRAME_TIMEOUT_S)
    if published is None:
        raise NotReadyError("no picture has been published yet", "try again when /readyz says ready")
    return Response(encode_display(published[1], ".jpg", 95), media_type="image/jpeg")


@router.get("/preview.mjpg", response_class=StreamingResponse, responses=STREAM_RESPONSE | error_responses(422, 503))
async def get_preview(
    api: ApiContextDep, width: Width = None, mirror: Mirror = False, fps: Fps = 30.0, before: Before = False
) -> StreamingResponse:
    """The published pictures as motion JPEG, for an `<img>`; or, to compare, the frames as filmed."""
    variant = PreviewVariant(width, mirror, fps, before)
    api.preview.check_capacity(variant)
    return StreamingResponse(
        motion_jpeg(api, variant), media_type=f"multipart/x-mixed-replace; boundary={MULTIPART_BOUNDARY}"
    )


async def motion_jpeg(api: ApiContext, variant: PreviewVariant) -> AsyncIterator[bytes]:
    """The parts of a multipart/x-mixed-replace body (Netscape's server push, which browsers still support).

    Each part is followed at once by the next boundary, since browsers show a part when they see its end. The generator
    is cancelled when the client leaves, which ends the viewing.
    """
    with suppress(NotReadyError), api.preview.subscribe(variant) as stream:  # others may have taken the last place
        count = -1
        yield f"--{MULTIPART_BOUNDARY}\r\n".encode()
        while not api.is_stopping() and not stream.ended:
            picture = await stream.next(count, FRAME_WAIT_S)
            if picture is None:
                continue
            count = picture.count
            head = f"Content-Type: image/jpeg\r\nContent-Length: {len(picture.jpeg)}\r\n\r\n"
            yield b"".join((head.encode(), picture.jpeg, f"\r\n--{MULTIPART_BOUNDARY}\r\n".encode()))
