"""The networks: are they there, and where do they really run."""

from __future__ import annotations

from importlib.resources import files

from relit_camera.config.settings import RelitSettings
from relit_camera.doctor.findings import Finding, fine, problem, problem_from, warning
from relit_camera.errors import RelitError
from relit_camera.models.providers import available_providers
from relit_camera.models.registry import Registry, State
from relit_camera.models.session import SessionOptions, open_session

NEEDED = {
    "mesh": ("face_mesh", "face_detector_yunet"),
    "openseeface": ("openseeface", "face_detector_yunet"),
}
"""Models without which a tracker does not open. `recorded` needs none; others' plug-ins know their own."""


def check_models(settings: RelitSettings, registry: Registry | None = None) -> Finding:
    """The public models, by their sha256."""
    topic = "models"
    try:
        registry = registry or Registry()
        states = {name: registry.state(name) for name in registry.names()}
    except RelitError as error:
        return problem_from(topic, error)
    by_state = {state: [name for name, found in states.items() if found is state] for state in State}
    missing, damaged = by_state[State.MISSING], by_state[State.DAMAGED]
    parts = [f"{len(by_state[State.PULLED])} of {len(states)} in {registry.folder}"]
    parts += [f"{word}: {', '.join(names)}" for word, names in (("missing", missing), ("damaged", damaged)) if names]
    seen, cure = "; ".join(parts), "run: relit models pull"
    tracker = settings.tracker.name.partition(":")[0]
    lacking = [name for name in NEEDED.get(tracker, ()) if states.get(name, State.PULLED) is not State.PULLED]
    if lacking:
        return problem(topic, f"tracker {tracker} lacks {', '.join(lacking)}; {seen}", cure)
    if missing or damaged:
        return warning(topic, seen, cure)
    return fine(topic, seen)


def check_provider(settings: RelitSettings) -> Finding:
    """Open the packaged motion graph with the configured provider, and see where its nodes were placed."""
    topic, inference = "provider", settings.inference
    graph = files("relit_camera.reenact").joinpath("first_order_motion.onnx").read_bytes()
    try:
        session = open_session(
            graph, "first_order_motion", SessionOptions(inference.provider, inference.threads, inference.strict)
        )
    except RelitError as error:
        return problem_from(topic, error)
    report = session.report
    nodes = f"{report.placement.get(report.provider, 0)} of {sum(report.placement.values())} nodes"
    seen = f"{report.provider} ({nodes}; asked for: {report.requested}; built in: {', '.join(available_providers())})"
    return warning(topic, f"{seen}; {report.why}", report.cure) if report.why else fine(topic, seen)
