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


class FileState(StrEnum):
    """What became of a file or folder that `--fix` looks after."""

    WRITTEN = "written"
    RENEWED = "renewed"
    """It was an older one of ours, which nobody had changed."""
    UNCHANGED = "unchanged"
    KEPT = "kept"
    """A person has changed it, or wrote it: it was left alone."""
    FAILED = "failed"


class FixedFile(BaseModel):
    """A file or folder, and what became of it."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    path: str
    state: FileState
    note: str = ""
    """Why it failed, or from what was kept to what we would have written, as a unified diff."""


class Fix(BaseModel):
    """What `--fix` did: files of the user's own. The rest are lines to paste."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    files: tuple[FixedFile, ...]
    root_commands: tuple[str, ...]
    """For root, in order; empty where nothing is left to do."""
    user_commands: tuple[str, ...]
    """Worth running as oneself: nothing is downloaded or started unasked."""


class Report(BaseModel):
    """Everything that was looked at."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    version: str
    """Of Relit Camera."""
    findings: tuple[Finding, ...]
    fix: Fix | None = None
    """What `--fix` did, and what is left for others."""

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
