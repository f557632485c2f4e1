"""A whole capture from a film through the API: sent, read by a real worker, reported, stored and shown."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from relit_camera.app.captures.film.film_progress import SHARES
from tests.api.api_client import decoded_picture
from tests.capture.film.generated_film import FOCAL_PX, SIZE
from tests.capture.film.pipeline import unusable_films as films
from tests.small_camera import Camera, memory_source, running_camera

PATIENCE_S = 240.0
"""For a machine that has much else to do; alone it takes half a minute."""
FIELDS = {
    "name": "me",
    "size": "64",
    "focal_px": str(FOCAL_PX),
    "face": ",".join(f"{value:.2f}" for value in films.FACE),
    "ball": f"{SIZE[0] / 2 + 70},{SIZE[1] / 2 - 80},30",
}


def followed(camera: Camera) -> list[dict[str, Any]]:
    """What the API tells of the capture until it ends."""
    told: list[dict[str, Any]] = []
    ends_at = time.monotonic() + PATIENCE_S
    while not told or told[-1]["stage"] in ("reading", "building"):
        assert time.monotonic() < ends_at, told[-1]
        told.append(camera.http.get("captures/film").raise_for_status().json())
        time.sleep(0.1)
    return told


@pytest.mark.slow
def test_a_film_is_sent_read_reported_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(tmp_path / "models"))  # the head of this film is none that one knows
    with running_camera(tmp_path / "data", memory_source(count=1)) as camera:
        with films.good_film().open("rb") as file:
            answer = camera.http.post("captures/film", data=FIELDS, files={"file": ("evening.mp4", file)})
        assert answer.status_code == 202, answer.text
        told = followed(camera)
        done = told[-1]
        assert done["stage"] == "done", done
        assert [each["progress"] for each in told] == sorted(each["progress"] for each in told)
        running = {step["name"] for each in told for step in each["stages"] if step["state"] == "running"}
        assert len(running & set(SHARES)) > 4  # short ones may be missed
        report = done["report"]
        assert report["verdict"] == "usable"
        assert "no face detector is installed" in report["because"]
        assert 0.3 < report["covered_fraction"] < 0.6
        assert report["frames"] == films.GOOD.frames
        assert report["used"] > 30
        assert "part of the exposure" in report["dropped"][0]["why"]
        assert camera.status()["subject"] == "me"
        assert camera.status()["mode"] == "live"
        details = camera.http.get("subjects/me").json()["metadata"]
        assert (details["rung"], details["width"], details["source"]) == ("film", 64, "evening.mp4")
        pictures = {
            path: decoded_picture(camera.http.get(path.removeprefix("/api/v1/")).raise_for_status().content)
            for path in report["pictures"]
        }
        assert len(pictures) == 5
        assert all(picture.shape == (64, 64, 3) and picture.max() > 60 for picture in pictures.values())
        left, right = (
            next(picture for path, picture in pictures.items() if side in path) for side in ("the-left", "the-right")
        )
        assert left[:, :32].mean() > 1.5 * left[:, 32:].mean()
        assert right[:, 32:].mean() > 1.5 * right[:, :32].mean()
        kept = {path.name for path in (tmp_path / "data" / "captures" / "film").iterdir()}
        assert kept == {"capture.json", "pictures"}
        # The pictures of a subject that is deleted are not kept either.
        camera.put("subject", name=None)
        assert camera.http.delete("subjects/me").status_code == 204
        assert camera.http.get("captures/film").json()["stage"] == "idle"
        assert list((tmp_path / "data" / "captures" / "film").iterdir()) == []


@pytest.mark.slow
def test_what_is_no_film_is_told_and_can_be_forgotten(tmp_path: Path) -> None:
    with running_camera(tmp_path / "data") as camera:
        sent = {"file": ("evening.mp4", b"no film at all")}
        assert camera.http.post("captures/film", data={"name": "me"}, files=sent).status_code == 202
        failed = followed(camera)[-1]
        assert failed["stage"] == "failed"
        assert "'evening.mp4'" in failed["what"]
        assert failed["cure"]
        assert failed["can_resume"]
        assert camera.http.delete("captures/film?forget=true").json()["stage"] == "idle"
        assert list((tmp_path / "data" / "captures" / "film").iterdir()) == []
