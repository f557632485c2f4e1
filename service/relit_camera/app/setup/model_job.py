"""Pulls the public models beside the running camera, in a worker process, when the user asks for it in the panel."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace

from relit_camera.app.background_job import BackgroundJob, describe_failure
from relit_camera.base.concurrency.worker_process import Progress, run_in_worker_process
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.setup_status import ModelPullStatus, ModelStage

PULL_TIMEOUT_S = 1800.0
"""A line of 0.2 Mbit/s has got them by then."""

Pull = Callable[[Progress], None]
"""Pulls the models and reports how far it is. A function of a module, since another process imports it."""


def pull_public_models(tell: Progress) -> None:
    """Store the public models that are not stored yet; tells what is done, and how many bytes of a file are there.

    Raises:
        ModelError: one cannot be had.
        StorageError: the models folder cannot be written.
    """
    from relit_camera.base.models.model_store import ModelStore

    def say(line: str) -> None:
        tell(line, 0, None)

    def report_bytes(name: str, there: int, size: int | None) -> None:
        tell(f"getting {name}", there, size)

    ModelStore().pull(say=say, report=report_bytes)


class ModelJob:
    """One pull at a time; its steps are the event `models`."""

    def __init__(
        self,
        events: EventHub,
        missing: Callable[[], Sequence[str]],
        on_done: Callable[[], None],
        pull: Pull = pull_public_models,
    ) -> None:
        """Set up; `start` begins.

        Args:
            events: hears `models` at each step.
            missing: names the models that are needed and not stored.
            on_done: called when all are there.
            pull: pulls them, in a worker process.
        """
        self._events, self._missing, self._on_done, self._pull = events, missing, on_done, pull
        self._status = ModelPullStatus()
        self._job = BackgroundJob("model-pull", "the models are being pulled already")

    def status(self) -> ModelPullStatus:
        """Which models are missing, and how far the last pull is."""
        return replace(self._status, missing=tuple(self._missing()))

    def start(self) -> ModelPullStatus:
        """Begin to pull.

        Raises:
            ConflictError: a pull is under way.
        """
        with self._job.taken() as canceled:
            self._set(ModelPullStatus(ModelStage.PULLING))
            self._job.begin(lambda: self._run(canceled), self._set)
        return self.status()

    def cancel(self) -> ModelPullStatus:
        """End the pull that is under way, if one is."""
        self._job.cancel()
        return self.status()

    def _run(self, canceled: threading.Event) -> ModelPullStatus:
        """Pull; returns how it ended."""
        try:
            run_in_worker_process(self._pull, timeout_s=PULL_TIMEOUT_S, canceled=canceled, progress=self._note_progress)
            self._on_done()
        except Exception as error:  # also a fault: else nobody would hear that it has ended
            if not canceled.is_set():
                what, cure = describe_failure("models", error)
                return ModelPullStatus(ModelStage.FAILED, what=what, cure=cure)
        if canceled.is_set():
            return ModelPullStatus(ModelStage.CANCELED)
        return ModelPullStatus(ModelStage.DONE, progress=1.0)

    def _note_progress(self, doing: str, done: int, total: int | None) -> None:
        share = min(1.0, done / total) if total else 0.0
        self._set(ModelPullStatus(ModelStage.PULLING, progress=round(share, 2), doing=doing))

    def _set(self, status: ModelPullStatus) -> None:
        if status == self._status:
            return  # a hundred steps a file are enough
        self._status = status
        self._events.publish("models", **vars(self.status()))
