"""What is made of rendered frames: a plain video, and one as a webcam takes it, of the same light."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.tone_mapping import linear_from_display
from relit_camera.base.video.video_readers import VideoReader
from relit_studio.cameras.studio_camera import Camera
from relit_studio.drive.clip_files import write_clip
from relit_studio.drive.painted_rooms import paint_room
from relit_studio.drive.performances.away import AWAY
from relit_studio.drive.room import Room
from relit_studio.drive.take import Take
from relit_studio.people.person import Person

WIDTH, HEIGHT = 160, 90
TIMES = (0.0, 0.25, 3.0)
INSIDE = np.s_[30:60, 60:100]
LIGHT = 1.3


@pytest.fixture
def take(person: Person) -> Take:
    return Take(person, AWAY, Camera(HEIGHT, WIDTH))


@pytest.fixture
def frames(tmp_path: Path) -> list[tuple[Path, float]]:
    """Two frames of an evenly lit square, and one of nobody."""
    made = []
    for index, time_s in enumerate(TIMES):
        alpha = np.zeros((HEIGHT, WIDTH), np.float32)
        alpha[20:70, 50:110] = time_s < 1
        path = tmp_path / f"{index:04d}.exr"
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {name: alpha * np.float32(LIGHT) for name in "RGB"} | {"A": alpha}).write(str(path))
        made.append((path, time_s))
    return made


def read(folder: Path, name: str) -> list[np.ndarray]:
    with VideoReader(folder / name) as video:
        return [frame.image for frame in video]


def truth_of(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "truth.json").read_text())
    return document


@pytest.mark.slow
def test_a_plain_clip_is_exposed_as_the_truth_says(
    take: Take, frames: list[tuple[Path, float]], tmp_path: Path
) -> None:
    write_clip(take, Room(paint_room("soft")), tmp_path, frames, None)
    truth = truth_of(tmp_path)
    assert truth["webcam"] is None
    assert truth["performance"] == "away"
    assert [frame["found"] for frame in truth["frames"]] == [True, True, False]
    shown = linear_from_display(read(tmp_path, "clip.mp4")[0])[INSIDE].mean()
    assert shown == pytest.approx(LIGHT * truth["exposure_scale"], rel=0.03)
    matte = read(tmp_path, "matte.mp4")
    assert matte[0][INSIDE].min() > 250
    assert matte[0][:10].max() < 5
    assert matte[2].max() < 5


@pytest.mark.slow
def test_a_webcams_picture_divided_by_its_gains_is_the_light(
    take: Take, frames: list[tuple[Path, float]], tmp_path: Path
) -> None:
    write_clip(take, Room(paint_room("soft")), tmp_path, frames, 3)
    truth, pictures = truth_of(tmp_path), read(tmp_path, "clip.mp4")
    assert truth["webcam"]["seed"] == 3
    for frame, picture in zip(truth["frames"][:2], pictures, strict=False):
        gain = truth["webcam"]["sensor"]["white"] * frame["exposure_gain"] * np.array(frame["white_balance_gain"])
        np.testing.assert_allclose(linear_from_uint8(picture)[INSIDE].mean(axis=(0, 1)) / gain, LIGHT, rtol=0.03)
    gains = [frame["exposure_gain"] for frame in truth["frames"]]
    assert gains[1] == pytest.approx(gains[0], rel=0.01)
    # Nothing of the frame that nobody is in has been seen when it is taken.
    assert gains[2] == pytest.approx(gains[1], rel=0.02)
    track = json.loads((tmp_path / "track.json").read_text())
    assert [frame["found"] for frame in track["frames"]] == [True, True, False]
