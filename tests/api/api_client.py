"""A client that needs no network, and what tests say of answers."""

from __future__ import annotations

import asyncio
from typing import Any

import cv2
import httpx
import numpy as np
from fastapi import FastAPI

from relit_camera.api.problem_details import MEDIA_TYPE
from relit_camera.base.images.image_types import DisplayImage

BASE_URL = "http://127.0.0.1:8470"


class Client:
    """Calls the application without a network, one event loop a request, from any thread."""

    def __init__(self, app: FastAPI) -> None:
        self.app = app

    def request(self, method: str, path: str, **options: Any) -> httpx.Response:
        async def send() -> httpx.Response:
            transport = httpx.ASGITransport(self.app, raise_app_exceptions=False)
            async with httpx.AsyncClient(transport=transport, base_url=BASE_URL) as client:
                return await client.request(method, path, **options)

        return asyncio.run(send())

    def get(self, path: str, **options: Any) -> httpx.Response:
        return self.request("GET", path, **options)

    def put(self, path: str, body: Any, **options: Any) -> httpx.Response:
        return self.request("PUT", path, json=body, **options)

    def patch(self, path: str, body: Any) -> httpx.Response:
        return self.request("PATCH", path, json=body)

    def post(self, path: str, **options: Any) -> httpx.Response:
        return self.request("POST", path, **options)

    def delete(self, path: str) -> httpx.Response:
        return self.request("DELETE", path)

    def upload(self, path: str, name: str, data: bytes, file_name: str) -> httpx.Response:
        return self.post(path, data={"name": name}, files={"file": (file_name, data)})


def check_problem(answer: httpx.Response, status: int) -> dict[str, Any]:
    """The body of an error answer, after checking what RFC 9457 and we promise of every one."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == MEDIA_TYPE
    body: dict[str, Any] = answer.json()
    assert body["status"] == status
    assert body["type"].startswith("urn:relit-camera:problem:")
    assert body["title"]
    assert body["what"]
    assert body["what"] in body["detail"]
    assert body.get("cure", "") in body["detail"]
    assert "Traceback" not in answer.text
    return body


def png(width: int = 64, height: int = 32, value: int = 128) -> bytes:
    """A picture file of one grey."""
    return bytes(cv2.imencode(".png", np.full((height, width, 3), value, np.uint8))[1])


def hdr(width: int = 64, height: int = 32) -> bytes:
    """A panorama file: grey, with one bright patch."""
    radiance = np.full((height, width, 3), 0.2, np.float32)
    radiance[4:8, 10:14] = 30
    return bytes(cv2.imencode(".hdr", radiance)[1])


def decoded_picture(data: bytes) -> DisplayImage:
    """The picture of a JPEG or PNG answer."""
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None, "not a picture"
    return np.ascontiguousarray(picture[..., ::-1])
