"""A short run of schemathesis; the long one is `python -m tests.api.api_fuzz --cases 10000`."""

from __future__ import annotations

import pytest

from tests.api.api_fuzz import fuzz


@pytest.mark.slow
def test_it_finds_nothing() -> None:
    status, cases, text = fuzz(150, seed=1)
    assert status == 0, text
    assert cases >= 150
