"""JPEG pictures as answers, with an ETag: a browser that has the same picture gets 304 instead."""

from __future__ import annotations

import hashlib
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from fastapi import Request
from starlette.responses import Response

from relit_camera.base.images.image_files import encode_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.images.resize import shrink

THUMBNAIL_WIDTH = 320
THUMBNAIL_QUALITY = 88
JPEG_RESPONSE: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "A JPEG picture",
        "content": {"image/jpeg": {"schema": {"type": "string", "format": "binary"}}},
    }
}
"""The OpenAPI entry of an operation that answers with a picture."""


def thumbnail_url_path(collection: str, name: str) -> str:
    """The URL path of the small picture of a stored environment, background or subject."""
    return f"/api/v1/{collection}/{quote(name)}/thumbnail.jpg"


def encode_thumbnail(picture: DisplayImage) -> bytes:
    """A JPEG file of uint8 sRGB RGB (height, width, 3), scaled down to at most 320 pixels wide."""
    return encode_display(shrink(picture, THUMBNAIL_WIDTH / picture.shape[1]), ".jpg", THUMBNAIL_QUALITY)


def jpeg_response(request: Request, jpeg: bytes) -> Response:
    """Answer with the picture, or with 304 if the request's If-None-Match names it."""
    tag = f'"{hashlib.sha256(jpeg).hexdigest()[:32]}"'
    headers = {"ETag": tag, "Cache-Control": "private, no-cache"}
    known = [known.strip().removeprefix("W/") for known in request.headers.get("if-none-match", "").split(",")]
    if tag in known or known == ["*"]:
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)
    return Response(jpeg, media_type="image/jpeg", headers=headers)
