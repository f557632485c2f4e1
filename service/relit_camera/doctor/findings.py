"""What the doctor says: one finding a topic."""

from __future__ import annotations

from enum import StrEnum

from pydantic import BaseModel, ConfigDict

from relit_camera.errors import RelitError


class State(StrEnum):
    """How bad it is."""

    OK = "ok"
    WARNING = "warning"
    """The camera works, but not as well as it could."""
    PROBLEM = "problem"
    """The camera will not work with these settings."""


class Finding(BaseModel):
    """One topic."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    topic: str
    """A fixed name, such as `webcam`."""
    state: State
    seen: str
    """What was seen, in one clause."""
    cure: str = ""
    """What to do, where the state is not ok."""


class Report(BaseModel):
    """Everything that was looked at."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    version: str
    """Of Relit Camera."""
    findings: tuple[Finding, ...]

    @property
    def healthy(self) -> bool:
        """Whether there is no problem; warnings may be."""
        return all(finding.state is not State.PROBLEM for finding in self.findings)


def fine(topic: str, seen: str) -> Finding:
    """All is well."""
    return Finding(topic=topic, state=State.OK, seen=seen)


def warning(topic: str, seen: str, cure: str) -> Finding:
    """It could be better."""
    return Finding(topic=topic, state=State.WARNING, seen=seen, cure=cure)


def problem(topic: str, seen: str, cure: str) -> Finding:
    """It will not work."""
    return Finding(topic=topic, state=State.PROBLEM, seen=seen, cure=cure)


def problem_from(topic: str, error: RelitError) -> Finding:
    """What an error says, which knows its cure."""
    return problem(topic, error.what, error.cure)
