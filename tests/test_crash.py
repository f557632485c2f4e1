"""State survives `kill -9`: three times here, two hundred by hand (`python -m tests.crash`)."""

from __future__ import annotations

import pytest

from tests.crash import run


@pytest.mark.slow
@pytest.mark.timeout(900)  # twenty seconds on an idle machine
def test_what_is_stored_survives_kill_9() -> None:
    found = run(kills=3, seed=7)
    assert found["wrong"] == []
    changes = found["changes"]
    assert isinstance(changes, int)
    assert changes > 3
