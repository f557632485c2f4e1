"""Files that clients send."""

from __future__ import annotations

from fastapi import UploadFile

from relit_camera.api.bodies import MAX_UPLOAD_BYTES, too_large
from relit_camera.errors import InputError


def read_upload(file: UploadFile) -> bytes:
    """The bytes of a file in a multipart form.

    Raises:
        TooLargeError: more than 64 MiB.
        InputError: it is empty.
    """
    data = file.file.read(MAX_UPLOAD_BYTES + 1)
    if len(data) > MAX_UPLOAD_BYTES:
        raise too_large(len(data), MAX_UPLOAD_BYTES)
    if not data:
        raise InputError(f"the file '{file.filename}' is empty", "choose a picture file")
    return data
