"""One session for all tests of a PipeWire version, and the camera in it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Self

import pytest

from tests.pipewire.portal import PortalSession
from tests.pipewire.session import Session, wait_for, what_is_missing

SUITES = os.environ.get("PIPEWIRE_SUITES", "own").split()
"""Packages of which each is tried; CI and `make test-pipewire` take a newer version too."""
NEEDED_VARIABLE = "PIPEWIRE_NEEDED"
"""Set, as in CI, where a missing PipeWire fails the tests instead of skipping them."""
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session", params=SUITES)
def suite(request: pytest.FixtureRequest) -> str:
    """A suite of packages that is unpacked here."""
    found: str = request.param
    if reason := what_is_missing(found):
        if os.environ.get(NEEDED_VARIABLE):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@pytest.fixture(scope="session")
def session(suite: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Session]:
    """A session in which nothing runs but its daemons."""
    with Session(suite, tmp_path_factory.mktemp("pipewire")) as session:
        yield session


@pytest.fixture(scope="module")
def portal(suite: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[PortalSession]:
    """A session with the portal, which is of this machine's own packages."""
    if reason := what_is_missing("own"):
        if os.environ.get(NEEDED_VARIABLE):
            pytest.fail(reason)
        pytest.skip(reason)
    with PortalSession(suite, tmp_path_factory.mktemp("portal")) as session:
        yield session


class PatternCamera:
    """`pattern_camera.py` in a session; what it tells is read all the time."""

    def __init__(self, session: Session, *arguments: object) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.pipewire.pattern_camera", *map(str, arguments)],
            env=session.environment,
            cwd=ROOT,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.told: list[dict[str, Any]] = []
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self._listener.join()
        assert self.process.stdout is not None
        self.process.stdout.close()

    @property
    def last(self) -> dict[str, Any]:
        """What it has told last."""
        return self.told[-1] if self.told else {}

    def wait_for(self, what: str, **expected: object) -> dict[str, Any]:
        """Wait until it tells these values."""
        return wait_for(lambda: self.last if expected.items() <= self.last.items() else None, f"{what}: {expected}")

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.told.append(json.loads(line))


@pytest.fixture
def camera(session: Session) -> Iterator[Callable[..., PatternCamera]]:
    """Starts a camera, which ends with the test."""
    started: list[PatternCamera] = []

    def start(*arguments: object) -> PatternCamera:
        started.append(PatternCamera(session, *arguments))
        return started[-1]

    yield start
    for each in started:
        each.__exit__()
