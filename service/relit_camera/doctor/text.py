"""The report as lines of plain text."""

from __future__ import annotations

from collections.abc import Iterator

from relit_camera.doctor.findings import FileState, Fix, Report, State


def table(report: Report) -> Iterator[str]:
    """State, topic, what was seen, a line each; the cure below it; then what `--fix` did."""
    width = max(len(finding.topic) for finding in report.findings)
    for finding in report.findings:
        yield f"{finding.state:<7}  {finding.topic:<{width}}  {finding.seen}"
        if finding.cure:
            yield f"{'':7}  {'':{width}}  → {finding.cure}"
    if report.fix is not None:
        yield from _fixed(report.fix)
    counts = [(state, sum(f.state is state for f in report.findings)) for state in (State.PROBLEM, State.WARNING)]
    found = [f"{count} {state}{'s' if count > 1 else ''}" for state, count in counts if count]
    yield f"Relit Camera {report.version}: {', '.join(found) or 'all is well'}"


def _fixed(fix: Fix) -> Iterator[str]:
    yield ""
    for file in fix.files:
        note = f": {file.note}" if file.state is FileState.FAILED else ""
        yield f"{file.state:<9}  {file.path}{note}"
        if file.state is FileState.KEPT:
            yield "           it was changed by hand; this would make it ours again:"
            yield from (f"           {line}" for line in file.note.splitlines())
    for title, lines in (("As root:", fix.root_commands), ("As yourself, if you want to:", fix.user_commands)):
        if lines:
            yield from ("", title, *(f"    {line}" for line in lines))
    yield ""
