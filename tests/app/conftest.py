"""Fixtures of the tests of what runs beside the camera."""

from __future__ import annotations

import multiprocessing

import pytest


@pytest.fixture
def forked_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fork worker processes from one that has imported the program, which takes a hundredth of a spawned one's start.

    They are processes all the same, that can be killed and can die. But environment variables that a test sets do not
    reach them.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        [
            "tests.app.desk_builders",
            "tests.app.film_builders",
            "tests.app.replay_writers",
            "tests.app.still_builders",
            "tests.app.subject_builders",
        ]
    )
    monkeypatch.setattr(multiprocessing, "get_context", lambda method: context)
