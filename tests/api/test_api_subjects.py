"""Who is shown."""

from __future__ import annotations

import json
import resource
from pathlib import Path

import numpy as np
import pytest

from relit_camera.subject.compression.local_basis import global_basis
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.subject import Subject, SubjectMetadata
from relit_camera.subject.subject_file import MAX_COPIED_BYTES, write_subject
from tests.api.api_client import Client, check_problem, decoded_picture
from tests.api.fake_camera import FakeCamera


@pytest.fixture
def stored(camera: FakeCamera) -> Path:
    """The folder of subjects, with one called ada."""
    folder = camera.scene_controller.subjects.folder
    folder.mkdir(parents=True)
    write_subject(folder / "ada.relit", small_subject())
    return folder


def small_subject() -> Subject:
    neutral = np.full((24, 16, 3), 90, np.uint8)
    matte = np.ones((24, 16), np.float32)
    return Subject(
        metadata=SubjectMetadata(
            width=16,
            height=24,
            method="nearest",
            lights=2,
            components=1,
            source="lights.lp",
            psnr_db=60.0,
            created_by="test",
            created_at="2026-01-01",
        ),
        basis=global_basis(np.ones((3, 1, 24, 16), np.float16), matte),
        coefficients=np.ones((1, TEXELS), np.float32),
        light_directions=np.array([[0, 0, 1], [1, 0, 0]], np.float32),
        light_coefficients=np.ones((1, 2), np.float32),
        matte=matte,
        neutral=neutral,
    )


def test_nobody_and_no_subjects_at_first(client: Client) -> None:
    assert client.get("/api/v1/subjects").json() == []
    assert client.get("/api/v1/subject").json() == {"name": None}


def test_a_subject_is_listed_chosen_and_deleted(client: Client, camera: FakeCamera, stored: Path) -> None:
    item = {"name": "ada", "is_current": False, "temporary": False, "thumbnail": "/api/v1/subjects/ada/thumbnail.jpg"}
    assert client.get("/api/v1/subjects").json() == [item]
    details = client.get("/api/v1/subjects/ada").json()
    assert details["metadata"]["method"] == "nearest"
    assert (details["metadata"]["width"], details["metadata"]["height"]) == (16, 24)

    assert client.put("/api/v1/subject", {"name": "ada"}).json() == {"name": "ada"}
    assert client.get("/api/v1/subject").json() == {"name": "ada"}
    assert client.get("/api/v1/status").json()["subject"] == "ada"
    assert camera.scene_controller.scene.subject is not None
    check_problem(client.delete("/api/v1/subjects/ada"), 409)

    assert client.put("/api/v1/subject", {"name": None}).json() == {"name": None}
    assert camera.scene_controller.scene.subject is None
    assert client.delete("/api/v1/subjects/ada").status_code == 204
    assert camera.film_capture.noted == [("ada",)]
    assert not (stored / "ada.relit").exists()
    check_problem(client.delete("/api/v1/subjects/ada"), 404)


def test_thumbnail_is_the_neutral_picture(client: Client, stored: Path) -> None:
    answer = client.get("/api/v1/subjects/ada/thumbnail.jpg")
    picture = decoded_picture(answer.content)
    assert picture.shape == (24, 16, 3)
    assert abs(picture.mean() - 90) < 2


def test_unknown_subjects_are_not_found(client: Client, camera: FakeCamera, stored: Path) -> None:
    problem = check_problem(client.put("/api/v1/subject", {"name": "adaa"}), 404)
    assert "'ada'" in problem["cure"]
    check_problem(client.get("/api/v1/subjects/bob"), 404)
    check_problem(client.get("/api/v1/subjects/bob/thumbnail.jpg"), 404)
    assert camera.scene_controller.scene.subject_name is None


def test_a_path_is_no_name(client: Client, camera: FakeCamera, stored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The command line takes files beside the program; the API must not reach them."""
    monkeypatch.chdir(stored)
    check_problem(client.put("/api/v1/subject", {"name": str(stored / "ada.relit")}), 422)
    check_problem(client.put("/api/v1/subject", {"name": "ada.relit"}), 404)
    assert camera.scene_controller.scene.subject is None


def test_a_damaged_subject_is_said_without_its_place(client: Client, camera: FakeCamera, stored: Path) -> None:
    (stored / "broken.relit").write_bytes(b"not a subject")
    answer = client.put("/api/v1/subject", {"name": "broken"})
    problem = check_problem(answer, 422)
    assert "broken.relit" in problem["what"]
    assert str(stored) not in answer.text
    assert camera.scene_controller.scene.subject is None
    assert [item["name"] for item in client.get("/api/v1/subjects").json()] == ["ada", "broken"]


def test_what_is_too_large_to_be_shown_is_told_and_seen(client: Client, camera: FakeCamera, stored: Path) -> None:
    """Its size is that of a tensor that nobody need read, and that takes no room on the disk."""
    path = stored / "ada.relit"
    data = path.read_bytes()
    start = 8 + int.from_bytes(data[:8], "little")
    header, size = json.loads(data[8:start]), MAX_COPIED_BYTES
    header["more"] = {"dtype": "U8", "shape": [size], "data_offsets": [len(data) - start, len(data) - start + size]}
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + data[start:])
    with path.open("ab") as file:
        file.truncate(file.tell() + size)

    problem = check_problem(client.put("/api/v1/subject", {"name": "ada"}), 422)
    assert "larger than 1 GiB" in problem["what"]
    assert camera.scene_controller.scene.subject is None
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert client.get("/api/v1/subjects/ada").json()["metadata"]["method"] == "nearest"
    assert client.get("/api/v1/subjects/ada/thumbnail.jpg").status_code == 200
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 << 10  # KiB


def test_the_demo_person_is_stored_once(client: Client, camera: FakeCamera) -> None:
    item = client.post("/api/v1/demo-subject").json()
    assert item["name"] == "demo person"
    stored = camera.scene_controller.subjects.path("demo person")
    assert stored.read_bytes() == camera.demo_subject.read_bytes()
    before = stored.stat().st_mtime_ns
    assert client.post("/api/v1/demo-subject").json() == item
    assert stored.stat().st_mtime_ns == before
    assert client.put("/api/v1/subject", {"name": "demo person"}).json() == {"name": "demo person"}


def test_a_subject_of_that_name_is_no_demo_person(client: Client, stored: Path) -> None:
    (stored / "ada.relit").rename(stored / "demo person.relit")
    check_problem(client.post("/api/v1/demo-subject"), 409)


@pytest.mark.slow
def test_a_subject_s_file_is_sent_and_stored(client: Client, camera: FakeCamera, stored: Path) -> None:
    data = (stored / "ada.relit").read_bytes()
    answer = client.upload("/api/v1/subjects", "bea", data, "evening.relit")
    assert answer.status_code == 201, answer.text
    assert answer.json() == {
        "name": "bea",
        "temporary": False,
        "is_current": False,
        "thumbnail": "/api/v1/subjects/bea/thumbnail.jpg",
    }
    assert (stored / "bea.relit").read_bytes() == data
    assert client.put("/api/v1/subject", {"name": "bea"}).json() == {"name": "bea"}
    check_problem(client.upload("/api/v1/subjects", "ada", data, "evening.relit"), 409)


def test_what_is_no_subject_is_told_by_its_own_name_and_not_kept(
    client: Client, camera: FakeCamera, stored: Path
) -> None:
    data = (stored / "ada.relit").read_bytes()
    for wrong in (b"no subject", data[:-40]):
        problem = check_problem(client.upload("/api/v1/subjects", "bea", wrong, "evening.relit"), 422)
        assert problem["what"].startswith("'evening.relit' is not a usable subject file")
    check_problem(client.upload("/api/v1/subjects", "../bea", data, "evening.relit"), 422)
    check_problem(client.upload("/api/v1/subjects", "bea", b"", "evening.relit"), 422)
    assert [path.name for path in stored.iterdir()] == ["ada.relit"]


def test_a_subject_is_renamed_also_while_it_is_shown(client: Client, camera: FakeCamera, stored: Path) -> None:
    client.put("/api/v1/subject", {"name": "ada"})
    revision = camera.scene_controller.scene.revision
    answer = client.patch("/api/v1/subjects/ada", {"name": "bea"})
    assert camera.film_capture.noted == [("ada", "bea")]
    assert answer.status_code == 200, answer.text
    assert (answer.json()["name"], answer.json()["is_current"]) == ("bea", True)
    assert client.get("/api/v1/subject").json() == {"name": "bea"}
    assert camera.scene_controller.scene.revision > revision
    assert [path.name for path in stored.iterdir()] == ["bea.relit"]
    check_problem(client.patch("/api/v1/subjects/ada", {"name": "cem"}), 404)
    check_problem(client.patch("/api/v1/subjects/bea", {"name": "../x"}), 422)
    write_subject(stored / "cem.relit", small_subject())
    check_problem(client.patch("/api/v1/subjects/bea", {"name": "cem"}), 409)
    assert client.patch("/api/v1/subjects/bea", {"name": "bea"}).status_code == 200
    assert client.get("/api/v1/subject").json() == {"name": "bea"}
