"""Somebody else than the subject moves no portrait of the running camera, unless a person has allowed that."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from relit_camera.app import wiring
from relit_camera.app.wiring import OTHER_PERSON_MESSAGE
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.lab.bench.synthetic_tracker import SyntheticTracker
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.status.camera_status import DegradationCode
from relit_camera.subject.subject_file import write_subject
from tests.generated_subject import small_subject
from tests.small_camera import FPS, PATIENT, SIZE, Camera, Embedder, difference, running_camera, wait_until


def patched(camera: Camera, **changes: object) -> None:
    camera.http.patch("scene", json=changes).raise_for_status()


def after(camera: Camera) -> list[DisplayImage]:
    """The pictures that are published in the next second, without one that is on its way."""
    count = camera.sink.count
    wait_until(lambda: camera.sink.count >= count + 2)
    camera.sink.new.clear()
    wait_until(lambda: camera.sink.count >= count + 2 + FPS)
    return list(camera.sink.new)


def test_a_portrait_is_hidden_from_who_it_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wiring, "FaceEmbedder", lambda session: Embedder(0.8))
    hidden, ada = placeholder(SIZE, OTHER_PERSON_MESSAGE), small_subject()
    bea = replace(ada, metadata=ada.metadata.model_copy(update={"created_at": "2027-01-01"}))
    with running_camera(tmp_path, tracker=SyntheticTracker(), timings=PATIENT) as camera:
        for name, subject in {"ada": ada, "bea": bea}.items():
            write_subject(camera.scene_controller.subjects.new_path(name), subject)
        for name in ("bea", "ada"):
            wait_until(lambda: camera.status()["state"] == "other-person")
            assert [difference(picture, hidden) for picture in after(camera)] == [0]
            assert DegradationCode.OTHER_PERSON in camera.degraded()
            patched(camera, avatar_allowed=True)
            wait_until(lambda: camera.status()["state"] == "live")
            moved = after(camera)
            assert len(moved) > 1
            assert min(difference(picture, hidden) for picture in moved) > 5
            assert camera.degraded() == set()
            patched(camera, subject=name)  # who may move one person's portrait may not move another's
        wait_until(lambda: camera.status()["state"] == "other-person")
        patched(camera, subject=None)
        wait_until(lambda: camera.degraded() == {DegradationCode.NO_SUBJECT})
