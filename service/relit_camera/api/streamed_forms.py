"""Forms with one large file, which is written to disk as it arrives and never held in memory.

Starlette's own parser keeps files in the system's folder of temporary files, which may be memory.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack
from http import HTTPStatus
from pathlib import Path
from shutil import disk_usage
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ValidationError
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException

from relit_camera.api.middleware.body_limits import body_too_large
from relit_camera.base.errors import InputError, StorageError
from relit_camera.base.storage.atomic_files import storage_error
from relit_camera.base.storage.upload import Upload

if TYPE_CHECKING:
    from python_multipart.multipart import MultipartCallbacks

CHUNK_BYTES = 1 << 20
"""Data that is written at once: each write is handed to another thread."""
MAX_FIELD_BYTES = 4096
MAX_FIELDS = 32

Model = TypeVar("Model", bound=BaseModel)
FileOpener = Callable[[Mapping[str, str], str], AbstractContextManager[Upload]]
"""Called with the fields before the file, and with the file's name; gives what to write to for the length of a context,
which ends with the error where the form ends early."""


async def receive_form(request: Request, open_file: FileOpener, most_bytes: int) -> None:
    """Write the file of a form to where `open_file` says; its field is `file`, the last one.

    Half of the free space of the disk may be used.

    Args:
        request: whose body is the form.
        open_file: is called once, in another thread.
        most_bytes: of the file.

    Raises:
        HTTPException: 415, the body is no form; 400, it is not a whole one.
        RequestValidationError: the file is missing, or a field comes after it.
        TooLargeError: the file is too large.
        ConflictError: it was canceled meanwhile.
        StorageError: there is too little room for it, or it cannot be written.
        InputError: the file is empty.
        RelitError: of `open_file`.
    """
    kind, parameters = parse_options_header(request.headers.get("content-type", ""))
    if kind != b"multipart/form-data" or b"boundary" not in parameters:
        what = "the body is no form: send multipart/form-data"
        raise HTTPException(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, what)
    with_files = ExitStack()
    form = _Form(open_file, with_files, most_bytes, int(request.headers.get("content-length", 0)))
    try:
        parser = MultipartParser(parameters[b"boundary"], form.callbacks())
        waiting = bytearray()
        async for chunk in request.stream():
            form.require_wanted()
            waiting += chunk
            if len(waiting) >= CHUNK_BYTES:
                await run_in_threadpool(parser.write, bytes(waiting))
                waiting.clear()
        await run_in_threadpool(parser.write, bytes(waiting))
        await run_in_threadpool(form.require_whole)
    except BaseException as error:
        await run_in_threadpool(with_files.__exit__, *sys.exc_info())
        if isinstance(error, FormParserError):
            raise HTTPException(HTTPStatus.BAD_REQUEST, "the form cannot be read") from error
        raise
    await run_in_threadpool(with_files.close)


def read_fields(model: type[Model], fields: Mapping[str, str]) -> Model:
    """The fields of a form, checked.

    Raises:
        RequestValidationError: one is missing, unknown or wrong.
    """
    try:
        return model.model_validate(fields)
    except ValidationError as error:
        wrong = [{**each, "loc": ("body", *each["loc"])} for each in error.errors(include_url=False)]
        raise RequestValidationError(wrong) from error


def form_description(model: type[BaseModel], file: str) -> dict[str, Any]:
    """The OpenAPI entry of a form with the fields of `model` and a file, of which `file` says what it is."""
    schema = model.model_json_schema()
    content = {"type": "string", "contentMediaType": "application/octet-stream", "description": file}
    schema["properties"]["file"] = content
    schema["required"] = [*schema.get("required", []), "file"]
    return {"requestBody": {"required": True, "content": {"multipart/form-data": {"schema": schema}}}}


class _Form:
    """What the parser's callbacks have found so far."""

    def __init__(self, open_file: FileOpener, with_files: ExitStack, most_bytes: int, announced: int) -> None:
        self._open_file, self._with_files = open_file, with_files
        self._most_bytes, self._announced = most_bytes, announced
        self._fields: dict[str, str] = {}
        self._header = self._value = b""
        self._disposition = b""
        self._field, self._text = "", bytearray()
        self._in_file = self._whole = False
        self._file: BinaryIO | None = None
        self._upload: Upload | None = None
        self._written = 0

    def callbacks(self) -> MultipartCallbacks:
        return {
            "on_part_begin": self._part_begins,
            "on_header_field": self._header_name,
            "on_header_value": self._header_value,
            "on_header_end": self._header_ends,
            "on_headers_finished": self._headers_end,
            "on_part_data": self._data,
            "on_part_end": self._part_ends,
            "on_end": self._ends,
        }

    def require_wanted(self) -> None:
        """Check that the file is not canceled; with each chunk, for one that comes slowly is written seldom."""
        if self._upload is not None:
            self._upload.require_wanted()

    def require_whole(self) -> None:
        if self._file is None:
            raise _field_error("file", "field required", "missing")
        if not self._whole:
            raise HTTPException(HTTPStatus.BAD_REQUEST, "the form ends early")
        if not self._written:
            raise InputError("the file is empty", "choose another file")

    def _part_begins(self) -> None:
        self._disposition, self._text, self._in_file = b"", bytearray(), False

    def _header_name(self, data: bytes, start: int, end: int) -> None:
        self._header += data[start:end]

    def _header_value(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _header_ends(self) -> None:
        if self._header.lower() == b"content-disposition":
            self._disposition = self._value
        self._header = self._value = b""

    def _headers_end(self) -> None:
        _, options = parse_options_header(self._disposition)
        self._field = options.get(b"name", b"").decode(errors="replace")
        file_name = options.get(b"filename")
        if self._file is not None:
            raise _field_error(self._field, "comes after the file, which is the last field", "order")
        if file_name is None:
            if self._field == "file":
                raise _field_error("file", "is no file", "type")
            return
        if self._field != "file":
            raise _field_error(self._field, "is a file; the file's field is 'file'", "extra_forbidden")
        self._open(Path(file_name.decode(errors="replace").replace("\\", "/")).name)

    def _open(self, file_name: str) -> None:
        self._upload = self._with_files.enter_context(self._open_file(self._fields, file_name))
        path = self._upload.path
        free = disk_usage(path.parent).free
        if self._announced > free // 2:
            what = f"the file has {self._announced / 1e6:.0f} MB, the disk has {free / 1e6:.0f} MB left"
            raise StorageError(what, "half of it may be used: free some space")
        self._most_bytes = min(self._most_bytes, free // 2)
        try:
            self._file = self._with_files.enter_context(path.open("wb"))
        except OSError as error:
            raise storage_error(path, error) from error
        self._in_file = True

    def _data(self, data: bytes, start: int, end: int) -> None:
        if not self._in_file:
            self._text += data[start:end]
            if len(self._text) > MAX_FIELD_BYTES:
                raise _field_error(self._field, f"is longer than {MAX_FIELD_BYTES} bytes", "too_long")
            return
        assert self._file is not None
        assert self._upload is not None
        self.require_wanted()
        self._written += end - start
        if self._written > self._most_bytes:
            raise body_too_large(self._written, self._most_bytes)
        try:
            self._file.write(data[start:end])
        except OSError as error:
            raise storage_error(self._upload.path, error) from error

    def _part_ends(self) -> None:
        if self._in_file:
            assert self._file is not None
            assert self._upload is not None
            try:
                self._file.flush()
            except OSError as error:
                raise storage_error(self._upload.path, error) from error
            self._in_file = False
            return
        if self._field in self._fields:
            raise _field_error(self._field, "is given twice", "extra_forbidden")
        if len(self._fields) == MAX_FIELDS:
            raise _field_error(self._field, "is one field too many", "extra_forbidden")
        self._fields[self._field] = self._text.decode(errors="replace")

    def _ends(self) -> None:
        self._whole = True


def _field_error(field: str, message: str, kind: str) -> RequestValidationError:
    return RequestValidationError([{"type": kind, "loc": ("body", field), "msg": message, "input": None}])
