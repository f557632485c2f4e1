"""Routes of the devices, and of the choice of source and tracker while the camera runs."""

from __future__ import annotations

from relit_camera.api.bodies.setup_bodies import SourceChange, TrackerBody
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.live.status.setup_status import DeviceList, SourceStatus, TrackerChoice

router = api_router("setup")


@router.get("/devices")
def get_devices(api: ApiContextDep) -> DeviceList:
    """The webcams of this machine with their sizes and rates, and its virtual cameras."""
    return api.camera.setup.devices()


@router.get("/source")
def get_source(api: ApiContextDep) -> SourceStatus:
    """Where live frames come from now."""
    return api.camera.setup.source()


@router.patch("/source", responses=error_responses(404, 409, 422))
def change_source(api: ApiContextDep, change: SourceChange) -> SourceStatus:
    """Take frames from another webcam, or in another size or rate, without a stop of the camera.

    What is left out stays. The new source is tried first: one that gives no frames is a conflict, and the old one goes
    on. Pictures are made in a size no larger than this, and scaled to that of the virtual camera.
    """
    return api.camera.setup.change_source(change.device, change.width, change.height, change.fps)


@router.get("/tracker")
def get_tracker(api: ApiContextDep) -> TrackerChoice:
    """Which tracker follows the face now."""
    return api.camera.setup.tracker()


@router.put("/tracker", responses=error_responses(404, 409, 422))
def choose_tracker(api: ApiContextDep, tracker: TrackerBody) -> TrackerChoice:
    """Let another tracker follow the face, without a stop of the camera."""
    return api.camera.setup.change_tracker(tracker.name)
