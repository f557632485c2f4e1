"""A pull of models beside the camera, in a worker process: its steps, its end, and how it is canceled."""

from __future__ import annotations

from unittest.mock import patch

import pytest

from relit_camera.app.setup.model_job import ModelJob, Pull
from relit_camera.base.errors import ConflictError
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.setup_status import ModelStage
from tests.app.setup.worker_stand_ins import pull_for_ever, pull_nothing, pull_two
from tests.small_camera import wait_until


class Job:
    def __init__(self, pull: Pull) -> None:
        self.events, self.missing, self.done = EventHub(), ["face_mesh"], 0
        self.job = ModelJob(self.events, lambda: self.missing, self._finish, pull)

    def _finish(self) -> None:
        self.missing.clear()
        self.done += 1

    def wait(self) -> None:
        wait_until(lambda: not self.job.status().stage.is_running)


def test_each_step_is_told_and_the_end() -> None:
    job = Job(pull_two)
    assert job.job.status().stage is ModelStage.IDLE
    with job.events.listen() as heard, patch.object(job.events, "publish", wraps=job.events.publish) as publish:
        started = job.job.start()
        assert (started.stage, started.missing) == (ModelStage.PULLING, ("face_mesh",))
        job.wait()
        told = [heard.get().data for _ in range(heard.qsize())]
    assert job.done == 1
    assert (told[-1]["stage"], told[-1]["progress"], told[-1]["missing"]) == ("done", 1.0, ())
    assert told[-2]["doing"] == "face_mesh: stored"
    assert publish.call_count < 110  # of a thousand steps


def test_what_cannot_be_had_is_told_with_its_cure_and_can_be_tried_again() -> None:
    job = Job(pull_nothing)
    for _ in range(2):
        job.job.start()
        job.wait()
        status = job.job.status()
        assert (status.stage, status.what, status.cure) == (
            ModelStage.FAILED,
            "no host gives face_mesh",
            "check the network",
        )
    assert job.done == 0


def test_it_is_canceled_and_one_runs_at_a_time() -> None:
    job = Job(pull_for_ever)
    job.job.start()
    wait_until(lambda: job.job.status().progress == 0.5)
    with pytest.raises(ConflictError, match="already"):
        job.job.start()
    assert job.job.cancel().stage is ModelStage.CANCELED
    assert job.job.cancel().stage is ModelStage.CANCELED
    assert job.job.start().stage is ModelStage.PULLING
    job.job.cancel()
