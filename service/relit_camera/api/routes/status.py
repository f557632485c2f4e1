"""How the camera is doing."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from relit_camera.api.context import Context
from relit_camera.api.metrics import CONTENT_TYPE, exposition
from relit_camera.api.problems import NotReadyError, responses
from relit_camera.api.schemas import Health, Readiness
from relit_camera.stream.status import CameraStatus

router = APIRouter(tags=["status"])
probes = APIRouter(tags=["probes"])


@router.get("/status")
def get_status(api: Context) -> CameraStatus:
    """What is going on: state, rates, latency, and what works less well than asked."""
    return api.camera.status()


@probes.get("/healthz")
async def get_health() -> Health:
    """Whether the process is alive."""
    return Health()


@probes.get("/readyz", responses=responses(503))
def get_readiness(api: Context) -> Readiness:
    """Whether pictures are being published, be they new, held or the placeholder."""
    if api.ending():
        raise NotReadyError("the camera is stopping", "start it again")
    if api.camera.status().fps.published == 0:
        raise NotReadyError("no picture was published for three seconds", "GET /api/v1/status says why")
    return Readiness()


@probes.get(
    "/metrics",
    response_class=Response,
    responses={
        200: {"description": "Prometheus text format", "content": {"text/plain": {"schema": {"type": "string"}}}}
    },
)
def get_metrics(api: Context) -> Response:
    """The figures of the status for Prometheus."""
    return Response(exposition(api.camera.status()), media_type=CONTENT_TYPE)
