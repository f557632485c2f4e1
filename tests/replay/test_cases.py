"""Every case under tests/replay/cases comes out as it expects."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.replay.case import case_folders, read_case
from tests.replay.expectations import differences
from tests.replay.failures import keep
from tests.replay.materials import UnavailableError
from tests.replay.play import play


@pytest.mark.parametrize("folder", case_folders(), ids=lambda folder: folder.name)
def test_case(folder: Path) -> None:
    case = read_case(folder)
    try:
        played = play(case, folder)
    except UnavailableError as reason:
        pytest.skip(str(reason))
    wrong = differences(case, folder, played)
    assert not wrong, keep(case, folder, played, wrong)
