"""Keeps what a failing case showed, beside what was expected, for a person to look at."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_files import read_display, write_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import write_atomic
from tests.replay.case import Case
from tests.replay.expectations import expected_picture
from tests.replay.materials import ROOT
from tests.replay.play import Played

FAILURES = ROOT / "test-failures"
SHEET_COLUMNS = 8


def keep(case: Case, folder: Path, played: Played, wrong: list[str], root: Path = FAILURES) -> str:
    """Write the frames, a sheet and a report to `root`/NAME in place of an earlier run's; returns what to tell."""
    target = root / folder.name
    shutil.rmtree(target, ignore_errors=True)
    target.mkdir(parents=True)
    shown = _shown(case, len(played.relit))
    expected: list[DisplayImage | None] = []
    for index in shown:
        write_display(target / f"{index:04d}-seen.png", played.relit[index])
        kept = expected_picture(folder, index)
        expected.append(read_display(kept) if kept.is_file() else None)
        if kept.is_file():
            shutil.copyfile(kept, target / f"{index:04d}-expected{kept.suffix}")
    live, seen = ([pictures[index] for index in shown] for pictures in (played.live, played.relit))
    rows: list[Sequence[DisplayImage | None]] = [live, seen, expected]
    sheet = contact_sheet(rows, ["live", "seen", "expected"], [str(index) for index in shown])
    write_display(target / "sheet.png", sheet)
    report = {
        "wrong": wrong,
        "degraded": [vars(trouble) for trouble in played.troubles],
        "frames": [frame.as_json() for frame in played.frames],
    }
    write_atomic(target / "report.json", json.dumps(report, indent=1))
    listed = "\n".join(f"  - {line}" for line in wrong)
    return f"case {folder.name} came out otherwise:\n{listed}\nlook at {target / 'sheet.png'}; frames lie beside it"


def _shown(case: Case, count: int) -> list[int]:
    """The frames whose pictures or colours are looked at, else some spread over the clip."""
    looked_at = case.expect.pictures or case.expect.colours
    if looked_at is not None:
        return list(looked_at.frames)
    return list(range(0, count, max(1, count // SHEET_COLUMNS)))[:SHEET_COLUMNS]
