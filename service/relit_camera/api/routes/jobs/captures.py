"""Routes of captures that run beside the camera: a subject of the person who sits before the webcam now."""

from __future__ import annotations

from http import HTTPStatus

from relit_camera.api.bodies.schemas import DeskCaptureRequest, InstantCaptureRequest, ShownStep
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.live.status.capture_status import CaptureStatus
from relit_camera.live.status.desk_status import DeskCaptureStatus, DeskPlace

router = api_router("subjects")


@router.get("/captures/instant")
def get_instant_capture(api: ApiContextDep) -> CaptureStatus:
    """How far the last instant capture is; the event `capture` tells each change."""
    return api.camera.instant_capture.status()


@router.post("/captures/instant", status_code=HTTPStatus.ACCEPTED, responses=error_responses(409, 422))
def start_instant_capture(api: ApiContextDep, capture: InstantCaptureRequest) -> CaptureStatus:
    """Capture a subject from some three seconds of the webcam; it is stored and shown, in mode live."""
    return api.camera.instant_capture.start(capture.name)


@router.delete("/captures/instant")
def cancel_instant_capture(api: ApiContextDep) -> CaptureStatus:
    """End the instant capture that runs; nothing is stored then."""
    return api.camera.instant_capture.cancel()


@router.get("/captures/desk")
def get_desk_capture(api: ApiContextDep) -> DeskCaptureStatus:
    """How far the last desk capture is; the event `desk-capture` tells each change of its stage."""
    return api.camera.desk_capture.status()


@router.post("/captures/desk", status_code=HTTPStatus.ACCEPTED, responses=error_responses(409, 422))
def start_desk_capture(api: ApiContextDep, capture: DeskCaptureRequest) -> DeskCaptureStatus:
    """Capture a subject by the light of the screen; the page `/desk` shows the patterns."""
    return api.camera.desk_capture.start(capture.name, DeskPlace(**capture.model_dump(exclude={"name"})))


@router.put("/captures/desk/shown", responses=error_responses(422))
def show_desk_step(api: ApiContextDep, shown: ShownStep) -> DeskCaptureStatus:
    """Tell which step the page shows now; the page does so several times a second, else it counts as closed."""
    return api.camera.desk_capture.page_shows(shown.step)


@router.delete("/captures/desk")
def cancel_desk_capture(api: ApiContextDep) -> DeskCaptureStatus:
    """End the desk capture that runs, and put the webcam's controls back; nothing is stored then."""
    return api.camera.desk_capture.cancel()
