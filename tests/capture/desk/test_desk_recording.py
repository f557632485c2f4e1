"""Reading a folder of frames and desk.json: what is accepted, and what is refused in one clear line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relit_camera.base.errors import CaptureError, ImageError
from relit_camera.base.images.image_files import write_display
from relit_camera.capture.desk.desk_recording import MAX_SETUP_BYTES, read_desk_recording

SETUP: dict[str, Any] = {
    "screen": {"width_cm": 58.5, "height_cm": 34.4},
    "distance_cm": 60,
    "camera": {"up_cm": 18},
    "patches": {"columns": 3, "rows": 2},
}


def folder_of(tmp_path: Path, setup: object = SETUP, frames: int = 20, size: tuple[int, int] = (160, 120)) -> Path:
    for index in range(frames):
        picture = np.full((size[1], size[0], 3), index, np.uint8)
        write_display(tmp_path / f"{index:03d}.png", picture)
    (tmp_path / "desk.json").write_text(setup if isinstance(setup, str) else json.dumps(setup), encoding="utf-8")
    return tmp_path


def test_frames_come_in_the_order_of_their_names(tmp_path: Path) -> None:
    recording = read_desk_recording(folder_of(tmp_path))
    assert [int(recording.frames[k][0, 0, 0]) for k in range(len(recording.frames))] == list(range(20))
    assert recording.size == (160, 120)
    assert len(recording.setup.patterns) == 16
    assert recording.room is None


def test_a_picture_of_the_room_is_no_frame(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, SETUP | {"room_picture": "000.png"})
    recording = read_desk_recording(folder)
    assert len(recording.frames) == 19
    assert recording.room is not None
    assert not recording.room.any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"screen": {"width_cm": 2, "height_cm": 34}}, "screen.width_cm"),
        ({"distance_cm": 5}, "distance_cm"),
        ({"patches": {"columns": 30, "rows": 2}}, "patches.columns"),
        ({"sequence": ["black", "white", [1, 0], "black"]}, r"sequence\[2\] has 2 values, there are 6 patches"),
        ({"sequence": ["black", "white", [1, 0, 0, 0, 0, 3], "black"]}, "sequence"),
        ({"shown": [0, 99]}, r"shown\[1\] is 99, the sequence has 16"),
        ({"shown": [0, 1]}, "holds 20 frames, shown in desk.json lists 2"),
        ({"room_picture": "../secret.png"}, "name of a file in the folder"),
        ({"unheard_of": 1}, "unheard_of"),
        ({"camera": {}}, "camera.up_cm"),
        ({"distance_cm": float("nan")}, "desk.json"),
        ({"format_version": 2}, "format_version"),
    ],
)
def test_a_wrong_setup_is_named_with_its_place(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    folder = folder_of(tmp_path, SETUP | change)
    with pytest.raises(CaptureError, match=message):
        read_desk_recording(folder)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "\x00", "[" * 100_000, "{}"])
def test_what_is_no_setup_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(CaptureError, match=r"desk\.json"):
        read_desk_recording(folder_of(tmp_path, text))


def test_a_huge_setup_is_not_parsed(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    with (folder / "desk.json").open("wb") as file:
        file.truncate(MAX_SETUP_BYTES + 1)
    with pytest.raises(CaptureError, match="larger than 1 MiB"):
        read_desk_recording(folder)


def test_missing_things_are_named(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="there is no folder"):
        read_desk_recording(tmp_path / "nowhere")
    with pytest.raises(CaptureError, match=r"desk\.json cannot be read"):
        read_desk_recording(tmp_path)
    with pytest.raises(CaptureError, match="holds 3 frames"):
        read_desk_recording(folder_of(tmp_path, frames=3))


def test_frames_of_another_size_and_small_ones_are_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    write_display(folder / "007.png", np.zeros((60, 80, 3), np.uint8))
    recording = read_desk_recording(folder)
    with pytest.raises(CaptureError, match=r"007.png is 80x60, the first frame is 160x120"):
        recording.frames[7]
    write_display(folder / "000.png", np.zeros((60, 80, 3), np.uint8))
    with pytest.raises(CaptureError, match="pixels a side"):
        read_desk_recording(folder)


def test_a_damaged_frame_is_named(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    (folder / "004.png").write_bytes(b"\x89PNG\r\n\x1a\n broken")
    recording = read_desk_recording(folder)
    with pytest.raises(ImageError, match=r"004\.png"):
        recording.frames[4]
