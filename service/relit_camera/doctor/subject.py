"""Who is shown."""

from __future__ import annotations

from relit_camera.config.settings import RelitSettings
from relit_camera.doctor.findings import Finding, fine, problem_from, warning
from relit_camera.errors import RelitError
from relit_camera.subject.store import SubjectStore


def check_subject(settings: RelitSettings) -> Finding:
    """The subject that the settings name: there and whole. With none the live picture passes through."""
    topic, store = "subject", SubjectStore(settings.storage.subjects, held=True)  # as the camera does
    stored = ", ".join(store.names())
    if settings.subject is None:
        cure = f"choose one by `subject:` in config.yaml or --subject; stored are: {stored}"
        if not stored:
            cure = "make one: relit capture build FILM --out me.relit; or see `relit demo`"
        return warning(topic, "none is chosen: the live picture passes through", cure)
    try:
        name, subject = store.resolve(settings.subject)
    except RelitError as error:
        return problem_from(topic, error)
    return fine(topic, f"{name}, {subject.metadata.width}x{subject.metadata.height}")
