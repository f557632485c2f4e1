"""Routes for monitoring: the status as JSON, the liveness and readiness probes, and the metrics for Prometheus."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fastapi import APIRouter
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    InfoMetricFamily,
    Metric,
    StateSetMetricFamily,
)
from starlette.responses import Response

from relit_camera.api.bodies.schemas import Health, Readiness
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.openapi.openapi_document import operation_id
from relit_camera.api.problem_details import error_responses
from relit_camera.base.errors import NotReadyError
from relit_camera.live.status.camera_status import CameraState, CameraStatus, Percentiles

METRICS_CONTENT_TYPE: str = CONTENT_TYPE_LATEST


def prometheus_exposition(status: CameraStatus) -> bytes:
    """The status in the Prometheus text format, by a registry of its own: without metrics of the Python process."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_StatusCollector(status))
    return bytes(generate_latest(registry))


class _StatusCollector:
    """A Prometheus collector of one status."""

    def __init__(self, status: CameraStatus) -> None:
        self.status = status

    def describe(self) -> Iterable[Metric]:
        return ()

    def collect(self) -> Iterator[Metric]:
        status = self.status
        yield InfoMetricFamily("relit_build", "The running program", value={"version": status.version})
        yield GaugeMetricFamily("relit_uptime_seconds", "Since the start", status.uptime_s)
        states = {state.value: state is status.state for state in CameraState}
        yield StateSetMetricFamily("relit_state", "What is being published", states)

        fps = GaugeMetricFamily("relit_fps", "Frames a second", labels=["at"])
        for place, rate in vars(status.fps).items():
            fps.add_metric([place], rate)
        yield fps

        frames = CounterMetricFamily("relit_frames", "Frames since the start", labels=["fate"])
        for fate, count in vars(status.frames).items():
            frames.add_metric([fate], count)
        yield frames

        latency = GaugeMetricFamily(
            "relit_latency_seconds", "From a frame's arrival to its publication", labels=["quantile"]
        )
        for quantile, seconds in _quantiles(status.latency_ms):
            latency.add_metric([quantile], seconds)
        yield latency

        stages = GaugeMetricFamily("relit_stage_seconds", "Time in each stage", labels=["stage", "quantile"])
        for stage, times in status.stage_ms.items():
            for quantile, seconds in _quantiles(times):
                stages.add_metric([stage, quantile], seconds)
        yield stages

        used = CounterMetricFamily("relit_stage_processor_seconds", "Processor time of each stage", labels=["stage"])
        for stage, seconds in status.stage_processor_s.items():
            used.add_metric([stage], seconds)
        yield used

        if status.readers.count is not None:
            yield GaugeMetricFamily(
                "relit_readers", "Programs that take pictures from the virtual camera", status.readers.count
            )

        tracker = GaugeMetricFamily(
            "relit_tracker_state", "1 for the tracker's present state", labels=["name", "state"]
        )
        tracker.add_metric([status.tracker.name, status.tracker.state], 1)
        yield tracker
        yield GaugeMetricFamily("relit_degraded", "Things that work less well than asked", len(status.degraded))


def _quantiles(times_ms: Percentiles) -> tuple[tuple[str, float], ...]:
    return ("0.5", times_ms.p50 / 1000), ("0.95", times_ms.p95 / 1000)


router = api_router("status")
probe_router = APIRouter(tags=["probes"], generate_unique_id_function=operation_id)


@router.get("/status")
def get_status(api: ApiContextDep) -> CameraStatus:
    """What is going on: state, rates, latency, and what works less well than asked."""
    return api.camera.status()


@probe_router.get("/healthz")
async def get_health() -> Health:
    """Whether the process is alive."""
    return Health()


@probe_router.get("/readyz", responses=error_responses(503))
def get_readiness(api: ApiContextDep) -> Readiness:
    """Whether pictures are being published, be they new, held or the placeholder."""
    api.require_running()
    if api.camera.status().fps.published == 0:
        raise NotReadyError("no picture was published for three seconds", "GET /api/v1/status says why")
    return Readiness()


@probe_router.get(
    "/metrics",
    response_class=Response,
    responses={
        200: {"description": "Prometheus text format", "content": {"text/plain": {"schema": {"type": "string"}}}}
    },
)
def get_metrics(api: ApiContextDep) -> Response:
    """The figures of the status for Prometheus."""
    return Response(prometheus_exposition(api.camera.status()), media_type=METRICS_CONTENT_TYPE)
