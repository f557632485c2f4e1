"""Routes of the capture from a film: the film is sent, a worker process makes a subject of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus

from fastapi import Request
from starlette.responses import Response

from relit_camera.api.bodies.job_schemas import FilmCaptureForm, FilmOptionFields
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.jpeg_responses import JPEG_RESPONSE, jpeg_response
from relit_camera.api.middleware.body_limits import MAX_FILM_BYTES
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.api.routes.jobs.busy_jobs import require_no_replay
from relit_camera.api.streamed_forms import form_description, read_fields, receive_form
from relit_camera.base.storage.upload import Upload
from relit_camera.live.status.film_status import FilmCaptureStatus

router = api_router("subjects", "/captures/film")


@router.get("")
def get_film_capture(api: ApiContextDep) -> FilmCaptureStatus:
    """How far the last capture from a film is; the event `film-capture` tells each change."""
    return api.camera.film_capture.status()


@router.post(
    "",
    status_code=HTTPStatus.ACCEPTED,
    responses=error_responses(409, 413, 415, 422, 503, 507),
    openapi_extra=form_description(FilmCaptureForm, "The film: .mp4, .mov, .m4v, .mkv, .webm or .avi."),
)
async def start_film_capture(api: ApiContextDep, request: Request) -> FilmCaptureStatus:
    """Capture a subject from a film of up to 4 GiB, and of half of the free space; the other fields come before `file`.

    The subject is stored, and shown unless somebody has chosen another one meanwhile.
    """

    @contextmanager
    def open_file(fields: Mapping[str, str], file_name: str) -> Iterator[Upload]:
        form = read_fields(FilmCaptureForm, fields)
        require_no_replay(api)
        with api.camera.film_capture.receive(form.name, file_name, form.options()) as upload:
            yield upload

    await receive_form(request, open_file, MAX_FILM_BYTES)
    return api.camera.film_capture.status()


@router.post("/resume", status_code=HTTPStatus.ACCEPTED, responses=error_responses(409, 422))
def resume_film_capture(api: ApiContextDep, options: FilmOptionFields | None = None) -> FilmCaptureStatus:
    """Go on with the film that is there, after it was canceled, the camera ended or it failed.

    With options in the body the film is read anew with these.
    """
    require_no_replay(api)
    return api.camera.film_capture.resume(None if options is None else options.options())


@router.delete("", responses=error_responses(409, 422))
def cancel_film_capture(api: ApiContextDep, forget: bool = False) -> FilmCaptureStatus:
    """End the capture that runs; nothing is stored then. `?forget=true` deletes the film and what was made of it."""
    return api.camera.film_capture.cancel(forget)


@router.get("/pictures/{name}.jpg", response_class=Response, responses=JPEG_RESPONSE | error_responses(404, 422))
def get_film_picture(api: ApiContextDep, request: Request, name: str) -> Response:
    """One of the report's pictures."""
    return jpeg_response(request, api.camera.film_capture.picture(name))
