"""What the doctor says: one finding a topic.

The report as lines of plain text.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

from pydantic import BaseModel, ConfigDict

from relit_camera.base.errors import RelitError


class Severity(StrEnum):
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
    state: Severity
    seen: str
    """What was seen, in one clause."""
    cure: str = ""
    """What to do, where the state is not ok."""


class FileOutcome(StrEnum):
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
    state: FileOutcome
    note: str = ""
    """Why it failed, or from what was kept to what we would have written, as a unified diff."""


class FixResult(BaseModel):
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
    fix: FixResult | None = None
    """What `--fix` did, and what is left for others."""

    @property
    def healthy(self) -> bool:
        """Whether there is no problem; warnings may be."""
        return all(finding.state is not Severity.PROBLEM for finding in self.findings)


def ok(topic: str, seen: str) -> Finding:
    """All is well."""
    return Finding(topic=topic, state=Severity.OK, seen=seen)


def warning(topic: str, seen: str, cure: str) -> Finding:
    """It could be better."""
    return Finding(topic=topic, state=Severity.WARNING, seen=seen, cure=cure)


def problem(topic: str, seen: str, cure: str) -> Finding:
    """It will not work."""
    return Finding(topic=topic, state=Severity.PROBLEM, seen=seen, cure=cure)


def problem_from_error(topic: str, error: RelitError) -> Finding:
    """What an error says, which knows its cure."""
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
