"""`python -m tests.replay.record CASE …`: take what comes out now as what is expected. Look at it before committing."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from relit_camera.base.errors import RelitError
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_files import write_display
from tests.replay.case import CASES, CaseError, case_folders, read_case
from tests.replay.expectations import record
from tests.replay.failures import FAILURES
from tests.replay.materials import UnavailableError
from tests.replay.play import play


def refresh(folder: Path, sheets: Path = FAILURES) -> str:
    """Play a case and write its expectations; returns what was found, and where a sheet to look at lies.

    Raises:
        CaseError: the case is wrong.
        UnavailableError: its data are not on this machine.
        RelitError: it cannot be played.
    """
    case = read_case(folder)
    played = play(case, folder)
    written = record(case, folder, played)
    every = max(1, len(played.relit) // 8)
    rows = [pictures[::every][:8] for pictures in (played.live, played.relit)]
    sheet = sheets / folder.name / "recorded.png"
    sheet.parent.mkdir(parents=True, exist_ok=True)
    write_display(
        sheet, contact_sheet(rows, ["live", "relit"], [str(i) for i in range(0, len(played.relit), every)][:8])
    )
    said = "".join(f"; {trouble.what}: {trouble.why}" for trouble in played.troubles)
    return (
        f"{folder.name}: {len(played.frames)} frames, face found in {played.found:.0%}{said}; "
        f"{len(written)} files written, look at {sheet}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 done, 1 a case could not be recorded."""
    parser = argparse.ArgumentParser(prog="python -m tests.replay.record", description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="names; all if none is given")
    names = parser.parse_args(arguments).cases
    for folder in [CASES / name for name in names] or case_folders():
        try:
            print(refresh(folder))
        except (CaseError, UnavailableError, RelitError) as error:
            print(f"{folder.name}: {error}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
