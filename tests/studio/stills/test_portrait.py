"""Single pictures: those that are finished stay."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from relit_camera.base.images.image_files import read_display, write_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.rotations import Angles
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.job import Quality
from relit_studio.drive.painted_rooms import paint_room
from relit_studio.drive.room import Room
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture
from relit_studio.stills import portrait

POSTURES = [Posture(Angles(yaw, 0.0, 0.0)) for yaw in (0.0, 10.0, 20.0)]


def gray(value: float) -> DisplayImage:
    return np.full((4, 4, 3), round(value), np.uint8)


@pytest.mark.slow
def test_only_missing_pictures_are_rendered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [tmp_path / f"{index}.png" for index in range(3)]
    write_display(paths[1], gray(99))
    made: list[float] = []

    def rendered(person: Any, postures: Sequence[Posture], *_: Any) -> list[DisplayImage]:
        made.extend(posture.angles.yaw for posture in postures)
        return [gray(posture.angles.yaw) for posture in postures]

    monkeypatch.setattr(portrait, "render_stills", rendered)
    for _ in range(2):
        portrait.finish_stills(paths, cast(Person, None), POSTURES, Room(paint_room("soft")), Camera(4), Quality())
    assert [int(read_display(path)[0, 0, 0]) for path in paths] == [0, 99, 20]
    assert made == [0, 20]
