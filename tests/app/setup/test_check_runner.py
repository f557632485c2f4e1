"""Who asks for the checks gets them from a worker process, some seconds old at most."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from relit_camera.app.setup import check_runner
from relit_camera.app.setup.check_runner import KEPT_S, CheckRunner
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.errors import WorkerError
from relit_camera.live.status.setup_status import Check, CheckState
from tests.app.setup.worker_stand_ins import no_check
from tests.virtual_clock import VirtualClock


class Runs:
    """Stands for the worker process; counts what it was asked for."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.count = 0
        self.error: WorkerError | None = None
        self.runner = CheckRunner(no_check, self, self.clock)

    def __call__(self, checks: Any, values: Any, timeout_s: float, canceled: threading.Event) -> tuple[Check, ...]:
        assert checks is no_check
        assert values["tracker"]["name"] == "mesh"
        self.count += 1
        if self.error is not None:
            raise self.error
        return (Check("webcam", "Webcam", CheckState.OK, f"look {self.count}"),)

    def found(self) -> Check:
        (check,) = self.runner.found(RelitSettings())
        return check


def test_an_answer_is_given_again_for_some_seconds() -> None:
    runs = Runs()
    assert [runs.found().what for _ in range(3)] == ["look 1"] * 3
    runs.clock.sleep(KEPT_S + 0.1)
    assert runs.found().what == "look 2"
    runs.runner.forget()  # something was mended
    assert runs.found().what == "look 3"


def test_checks_that_fail_are_one_that_is_unknown() -> None:
    runs = Runs()
    runs.error = WorkerError("the worker process died", "there may be too little memory")
    check = runs.found()
    assert (check.state, check.what) == (CheckState.UNKNOWN, "the worker process died")


@pytest.mark.slow
def test_they_run_in_a_process_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check_runner, "TIMEOUT_S", 120.0)  # the process has to wait for others
    assert CheckRunner(no_check).found(RelitSettings()) == ()
