"""Fixtures of the reenactors' tests."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread() -> Iterator[None]:
    """As in the running camera: on a busy machine BLAS's threads wait for each other far longer than they work."""
    with threadpool_limits(limits=1, user_api="blas"):
        yield
