"""The camera's status in the Prometheus text format."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    InfoMetricFamily,
    Metric,
    StateSetMetricFamily,
)

from relit_camera.stream.status import CameraState, CameraStatus, Percentiles

CONTENT_TYPE: str = CONTENT_TYPE_LATEST


def exposition(status: CameraStatus) -> bytes:
    """The status as a scrape's answer. The registry is made for it alone: nothing of the process is mixed in."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Snapshot(status))
    return bytes(generate_latest(registry))


class _Snapshot:
    """One status, as a Prometheus collector."""

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

        tracker = GaugeMetricFamily(
            "relit_tracker_state", "1 for the tracker's present state", labels=["name", "state"]
        )
        tracker.add_metric([status.tracker.name, status.tracker.state], 1)
        yield tracker
        yield GaugeMetricFamily("relit_degraded", "Things that work less well than asked", len(status.degraded))


def _quantiles(times_ms: Percentiles) -> tuple[tuple[str, float], ...]:
    return ("0.5", times_ms.p50 / 1000), ("0.95", times_ms.p95 / 1000)
