"""Checks of the models, of the execution provider that really runs them, and of the subject."""

from __future__ import annotations

from importlib.resources import files

from relit_camera.app.setup.needed_models import OF_TRACKER
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import DeviceError, RelitError
from relit_camera.base.models.model_store import ModelState, ModelStore
from relit_camera.base.models.provider_names import CPU, available_providers, choose_provider, full_name
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.doctor.report import Finding, ok, problem, problem_from_error, warning
from relit_camera.subject.subject_store import SubjectStore


def check_models(settings: RelitSettings, registry: ModelStore | None = None) -> Finding:
    """Check the public models by their sha256: stored, missing or damaged."""
    topic = "models"
    try:
        registry = registry or ModelStore()
        states = {name: registry.state(name) for name in registry.names()}
    except RelitError as error:
        return problem_from_error(topic, error)
    by_state = {state: [name for name, found in states.items() if found is state] for state in ModelState}
    damaged = by_state[ModelState.DAMAGED]
    missing = [name for name in registry.lacking() if name not in damaged]
    parts = [f"{len(by_state[ModelState.PULLED])} of {len(states)} in {registry.folder}"]
    parts += [f"{word}: {', '.join(names)}" for word, names in (("missing", missing), ("damaged", damaged)) if names]
    seen, cure = "; ".join(parts), "run: relit models pull"
    tracker = settings.tracker.name.partition(":")[0]
    lacking = [
        group[0]
        for group in OF_TRACKER.get(tracker, ())
        if not any(states.get(name) is ModelState.PULLED for name in group)
    ]
    if lacking:
        return problem(topic, f"tracker {tracker} lacks {', '.join(lacking)}; {seen}", cure)
    needed = [name for name in missing if registry.manifest.models[name].without is None]
    if needed or damaged:  # little is missing without the others, which the package index does not have
        return warning(topic, seen, cure)
    return ok(topic, seen)


def check_provider(settings: RelitSettings) -> Finding:
    """Open the packaged motion network with the configured provider, and report where its nodes were placed."""
    topic, inference = "provider", settings.inference
    graph = files("relit_camera.live.reenactment").joinpath("first_order_motion.onnx").read_bytes()
    try:
        session = open_session(
            graph, "first_order_motion", SessionOptions(inference.provider, inference.threads, inference.strict)
        )
    except DeviceError as error:
        return problem(topic, error.what, _provider_cure(choose_provider(inference.provider)))
    except RelitError as error:
        return problem_from_error(topic, error)
    report = session.report
    nodes = f"{report.placement.get(report.provider, 0)} of {sum(report.placement.values())} nodes"
    seen = f"{report.provider} ({nodes}; asked for: {report.requested}; built in: {', '.join(available_providers())})"
    if report.why:
        return warning(topic, f"{seen}; {report.why}", _provider_cure(choose_provider(report.requested)))
    return ok(topic, seen)


def _provider_cure(provider: str) -> str:
    """How to install a provider, or do without it."""
    if provider == "cuda":
        install = "install the NVIDIA driver, replace the package onnxruntime by onnxruntime-gpu[cuda,cudnn]"
    else:
        install = f"install a build of ONNX Runtime with {full_name(provider)}"
    return f"{install}, or set the provider to {CPU}"


def check_subject(settings: RelitSettings) -> Finding:
    """Check that the subject in the settings exists and can be read."""
    topic, store = "subject", SubjectStore(settings.storage.subjects, copied=True)  # as the camera does
    stored = ", ".join(store.names())
    if settings.named_subject is None:
        shown = "a placeholder is shown" if settings.subject is None else "you are lit as an average head would be"
        cure = f"choose one by `subject:` in config.yaml or --subject; stored are: {stored}"
        if not stored:
            cure = "make one: relit capture build FILM --out me.relit; or see `relit demo`"
        return warning(topic, f"none is chosen: {shown}", cure)
    try:
        name, subject = store.resolve(settings.named_subject)
    except RelitError as error:
        return problem_from_error(topic, error)
    return ok(topic, f"{name}, {subject.metadata.width}x{subject.metadata.height}")
