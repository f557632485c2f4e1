"""Routes of expression stills for a stored subject: taken from the webcam, or from a video that is sent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus

from fastapi import Request

from relit_camera.api.bodies.job_schemas import ExpressionCaptureRequest
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.middleware.body_limits import MAX_FILM_BYTES
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.api.routes.jobs.busy_jobs import require_no_replay
from relit_camera.api.streamed_forms import form_description, read_fields, receive_form
from relit_camera.base.storage.upload import Upload
from relit_camera.live.status.expression_status import ExpressionCaptureStatus

router = api_router("subjects", "/captures/expressions")


@router.get("")
def get_expression_capture(api: ApiContextDep) -> ExpressionCaptureStatus:
    """How far the last capture of expression stills is; the event `expression-capture` tells each change."""
    return api.camera.expression_capture.status()


@router.post("", status_code=HTTPStatus.ACCEPTED, responses=error_responses(404, 409, 422))
def start_expression_capture(api: ApiContextDep, capture: ExpressionCaptureRequest) -> ExpressionCaptureStatus:
    """Film the person before the webcam for some half a minute; `say` of the status tells what to do meanwhile.

    The stills replace those that the subject has.
    """
    return api.camera.expression_capture.start(capture.subject)


@router.post(
    "/video",
    status_code=HTTPStatus.ACCEPTED,
    responses=error_responses(404, 409, 413, 415, 422, 503, 507),
    openapi_extra=form_description(ExpressionCaptureRequest, "The video: .mp4, .mov, .m4v, .mkv, .webm or .avi."),
)
async def start_expression_video(api: ApiContextDep, request: Request) -> ExpressionCaptureStatus:
    """Take the stills from a video of that person, of up to 4 GiB and half of the free space; `subject` comes first.

    Two minutes of it are looked at. It is deleted when the work ends.
    """

    @contextmanager
    def open_file(fields: Mapping[str, str], file_name: str) -> Iterator[Upload]:
        subject = read_fields(ExpressionCaptureRequest, fields).subject
        require_no_replay(api)
        with api.camera.expression_capture.receive(subject, file_name) as upload:
            yield upload

    await receive_form(request, open_file, MAX_FILM_BYTES)
    return api.camera.expression_capture.status()


@router.delete("")
def cancel_expression_capture(api: ApiContextDep) -> ExpressionCaptureStatus:
    """End the capture that runs; the subject is as before then."""
    return api.camera.expression_capture.cancel()
