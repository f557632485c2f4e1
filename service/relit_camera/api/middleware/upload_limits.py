"""Uploads cannot take everything: few come at once, and the data folder has a quota."""

from __future__ import annotations

import os
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from relit_camera.api.middleware.bounded_body import answer_within
from relit_camera.api.problem_details import problem_response
from relit_camera.base.errors import StorageError

MAX_UPLOADS = 4
"""Forms with a file that are received at once."""
RETRY_AFTER_S = 5
PRESETS_PATH = "/api/v1/presets/"


class UploadLimitMiddleware:
    """ASGI middleware that answers 503 to an upload too many, and 507 to one beyond the quota.

    The folder is measured when an upload begins: those that are received at once may exceed it together.
    """

    def __init__(self, app: ASGIApp, folder: Path, most_bytes: int) -> None:
        """Set up.

        Args:
            app: answers what may pass.
            folder: the data folder.
            most_bytes: above which uploads are refused.
        """
        self.app = app
        self._folder, self._most_bytes = folder, most_bytes
        self._uploads = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http" or scope["method"] not in ("POST", "PUT", "PATCH"):
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        is_form = headers.get("content-type", "").lower().startswith("multipart/form-data")
        is_preset = scope["method"] == "PUT" and scope["path"].startswith(PRESETS_PATH)
        if not is_form and not is_preset:
            await self.app(scope, receive, send)
            return
        if is_form and self._uploads == MAX_UPLOADS:
            what, cure = f"{MAX_UPLOADS} files are being received already", "send it again in a few seconds"
            answer = problem_response(
                HTTPStatus.SERVICE_UNAVAILABLE, what, cure, headers={"Retry-After": str(RETRY_AFTER_S)}
            )
            await answer(scope, receive, send)
            return
        self._uploads += is_form
        try:
            await self._within_quota(scope, receive, send)
        finally:
            self._uploads -= is_form

    async def _within_quota(self, scope: Scope, receive: Receive, send: Send) -> None:
        room = max(self._most_bytes - await run_in_threadpool(_bytes_in, self._folder), 0)
        await answer_within(room, lambda size: _over_quota(self._most_bytes), self.app, scope, receive, send)


def _over_quota(most_bytes: int) -> StorageError:
    return StorageError(
        f"the data folder would hold more than {most_bytes / 1e9:.3g} GB",
        "delete what is not needed, or raise storage.quota_gb",
    )


def _bytes_in(folder: Path) -> int:
    """Bytes of all files in a folder and the folders in it; links are not followed."""
    return sum(_sizes(str(folder)))


def _sizes(folder: str) -> Iterator[int]:
    try:
        entries = os.scandir(folder)
    except OSError:  # there is none yet, or it is gone meanwhile
        return
    with entries:
        for entry in entries:
            try:
                if entry.is_dir(follow_symlinks=False):
                    yield from _sizes(entry.path)
                else:
                    yield entry.stat(follow_symlinks=False).st_size
            except OSError:  # gone meanwhile
                continue
