"""The doctor's report: one finding a topic, what `--fix` did, and both as lines of plain text."""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

from pydantic import BaseModel, ConfigDict

from relit_camera.base.errors import RelitError


class Severity(StrEnum):
    """How serious a finding is."""

    OK = "ok"
    WARNING = "warning"
    """The camera works, but not as well as it could."""
    PROBLEM = "problem"
    """The camera will not work with these settings."""


class Finding(BaseModel):
    """The result of one check."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    topic: str
    """A fixed name, such as `webcam`."""
    state: Severity
    seen: str
    """What was seen, in one clause."""
    cure: str = ""
    """What to do, where the state is not ok."""


class FileOutcome(StrEnum):
    """What `--fix` did with one of its files or folders."""

    WRITTEN = "written"
    RENEWED = "renewed"
    """It was written by an older version, and nobody had changed it."""
    UNCHANGED = "unchanged"
    KEPT = "kept"
    """A person wrote or changed it, so it was left as it is."""
    FAILED = "failed"


class FixedFile(BaseModel):
    """A file or folder, and what `--fix` did with it."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    path: str
    state: FileOutcome
    note: str = ""
    """The reason of a failure; or for a kept file a unified diff to the one that `--fix` would write."""


class FixResult(BaseModel):
    """What `--fix` did: it writes the user's own files, and prints commands for the rest."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    files: tuple[FixedFile, ...]
    root_commands: tuple[str, ...]
    """Commands that need root, in order; empty where nothing is left to do."""
    user_commands: tuple[str, ...]
    """Commands for the user: `--fix` itself downloads and starts nothing."""


class Report(BaseModel):
    """The results of all checks."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    version: str
    """Of Relit Camera."""
    findings: tuple[Finding, ...]
    fix: FixResult | None = None
    """What `--fix` did, and which commands are left."""

    @property
    def healthy(self) -> bool:
        """Whether no finding is a problem; there may be warnings."""
        return all(finding.state is not Severity.PROBLEM for finding in self.findings)


def ok(topic: str, seen: str) -> Finding:
    """A finding that needs no action."""
    return Finding(topic=topic, state=Severity.OK, seen=seen)


def warning(topic: str, seen: str, cure: str) -> Finding:
    """A finding with which the camera works, but not as well as it could."""
    return Finding(topic=topic, state=Severity.WARNING, seen=seen, cure=cure)


def problem(topic: str, seen: str, cure: str) -> Finding:
    """A finding with which the camera will not work."""
    return Finding(topic=topic, state=Severity.PROBLEM, seen=seen, cure=cure)


def problem_from_error(topic: str, error: RelitError) -> Finding:
    """The finding for an error, with the error's own cure."""
    return problem(topic, error.what, error.cure)


def report_lines(report: Report) -> Iterator[str]:
    """State, topic, what was seen, a line each; the cure below it; then what `--fix` did."""
    width = max(len(finding.topic) for finding in report.findings)
    for finding in report.findings:
        yield f"{finding.state:<7}  {finding.topic:<{width}}  {finding.seen}"
        if finding.cure:
            yield f"{'':7}  {'':{width}}  → {finding.cure}"
    if report.fix is not None:
        yield from _fix_lines(report.fix)
    counts = [(state, sum(f.state is state for f in report.findings)) for state in (Severity.PROBLEM, Severity.WARNING)]
    found = [f"{count} {state}{'s' if count > 1 else ''}" for state, count in counts if count]
    yield f"Relit Camera {report.version}: {', '.join(found) or 'all is well'}"


def _fix_lines(fix: FixResult) -> Iterator[str]:
    yield ""
    for file in fix.files:
        note = f": {file.note}" if file.state is FileOutcome.FAILED else ""
        yield f"{file.state:<9}  {file.path}{note}"
        if file.state is FileOutcome.KEPT:
            yield "           it was changed by hand; this would make it ours again:"
            yield from (f"           {line}" for line in file.note.splitlines())
    for title, lines in (("As root:", fix.root_commands), ("As yourself, if you want to:", fix.user_commands)):
        if lines:
            yield from ("", title, *(f"    {line}" for line in lines))
    yield ""
