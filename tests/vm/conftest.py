"""One machine for each version of v4l2loopback, and a table of what was seen in them (`tests.report_tables`)."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from relit_camera.devices.device_discovery import modprobe_command
from tests.vm.machine import Machine, what_is_missing
from tests.vm.program import program_disk

CHOSEN = os.environ.get("RELIT_VM_VERSIONS", "").split()
VERSIONS = CHOSEN or ["0.15.0"]
"""Of Debian 13. `make test-vm` tries 0.12.7 of Debian 12 and 0.13.2 of its backports too, for which CI has no time."""

NEEDED_VARIABLE = "VM_NEEDED"
"""Set, as in CI, where a missing machine fails the tests instead of skipping them."""

NEWEST = pytest.mark.parametrize("version", VERSIONS[-1:], indirect=True)
"""For what does not depend on the version."""
LONG = pytest.mark.parametrize("version", CHOSEN or VERSIONS[-1:], indirect=True)
"""For what takes minutes: by itself with one version, with all of them where they are asked for."""

AT_LENGTH = pytest.mark.skipif(not CHOSEN, reason="takes minutes: `make test-vm` runs it")
"""For what CI has no time for, with any version."""


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The disk with the program."""
    if reason := what_is_missing():
        if os.environ.get(NEEDED_VARIABLE):
            pytest.fail(reason)
        pytest.skip(reason)
    return program_disk(tmp_path_factory.mktemp("program"))


@pytest.fixture(scope="session", params=VERSIONS)
def version(request: pytest.FixtureRequest) -> str:
    """A version of v4l2loopback."""
    found: str = request.param
    return found


@pytest.fixture(scope="session")
def booted(program: Path, version: str) -> Iterator[Machine]:
    """A machine in which no module is loaded yet."""
    with Machine(program) as machine:
        link = f"ln -sf ../v4l2loopback-{version}.ko v4l2loopback.ko"
        machine.run(f"cd /lib/modules/*/loopback && {link}")
        yield machine


@pytest.fixture(scope="session")
def machine(booted: Machine) -> Machine:
    """A machine with the virtual camera, made by the command that we tell people."""
    booted.load(modprobe_command().removeprefix("sudo modprobe "))
    return booted


@pytest.fixture
def saw(version: str, note_row: Callable[[str, tuple[str, ...]], None]) -> Callable[[str, str], None]:
    """Notes what a reader saw, for the table."""
    return lambda reader, what: note_row("readers of the virtual camera", (reader, version, what))
