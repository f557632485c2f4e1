"""Which sinks a keeper holds, and where it is found."""

from __future__ import annotations

import mmap
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.keeper.kept_output import RGB, OutputOptions, SinkOutput
from relit_camera.devices.keeper.kept_sink import KeeperParts, KeptSink, keeper_for, kept_options
from relit_camera.devices.keeper.sink_keeper import SinkKeeper
from relit_camera.devices.sinks.sink import NullSink, SinkOptions

SIZE = (4, 2)
pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="keepers are Linux's")


@pytest.mark.parametrize(("sink", "name"), [("camera", "keeper-36f3b45e5666"), ("pipewire", "keeper-3feeb0957e94")])
def test_a_keeper_is_found_at_the_same_path_by_all_versions(sink: str, name: str) -> None:
    # As earlier versions have it: an upgraded camera that looks elsewhere would find the device in use.
    keeper = keeper_for(OutputSettings(sink=sink))
    assert keeper is not None
    assert keeper.path.name == name


def test_another_label_is_another_keeper_s() -> None:
    keepers = [keeper_for(OutputSettings(label=label)) for label in ("Relit Camera", "Other")]
    assert len({keeper.path for keeper in keepers if keeper is not None}) == 2


@pytest.mark.parametrize("sink", ["camera", "pipewire"])
def test_what_opens_it_is_the_installed_sink(sink: str) -> None:
    options = kept_options(OutputSettings(sink=sink))
    assert options is not None
    assert options.sink.startswith("relit_camera.devices.sinks.call_app_cameras:open_")
    with pytest.raises(InputError, match=f"sink '?{sink}'? takes no argument"):
        kept_options(OutputSettings(sink=f"{sink}:foo"))


@pytest.mark.parametrize("settings", [OutputSettings(sink="null"), OutputSettings(keep_s=0)])
def test_what_has_none(settings: OutputSettings) -> None:
    assert keeper_for(settings) is None


# A picture that is shown again.


class MemoryKeeper(SinkKeeper):
    """A keeper without a process, that looks into the memory: the slot and the first byte of each picture shown."""

    def __init__(self, folder: Path) -> None:
        super().__init__(OutputOptions(SIZE, 30.0, "Relit Camera"), 60.0, folder)
        self.shown: list[tuple[int, int]] = []

    def greet(self) -> Mapping[str, Any]:
        info = {"kind": "camera", "id": "", "size": SIZE, "pipewire": None, "trouble": None}
        return {"info": info, "layout": RGB, "size": SIZE}

    def share(self, descriptor: int) -> None:
        self.memory = mmap.mmap(descriptor, 0)

    def show(self, slot: int, repeatable: bool) -> Mapping[str, Any]:
        self.shown.append((slot, self.memory[slot * SIZE[0] * SIZE[1] * 3]))
        return {}


def grey(value: int) -> DisplayImage:
    return np.full((SIZE[1], SIZE[0], 3), value, np.uint8)


def test_a_picture_that_is_shown_again_lies_there_already(tmp_path: Path) -> None:
    keeper = MemoryKeeper(tmp_path)
    sink = KeptSink(keeper, KeeperParts(lambda size: grey(9)), lambda: NullSink(SIZE))
    first, second = grey(1), grey(2)
    for image in (first, first, second, first, first, grey(1)):
        sink.write(image)
    slots, values = zip(*keeper.shown, strict=True)
    assert values == (1, 1, 2, 1, 1, 1)
    assert slots == (1, 1, 0, 1, 1, 0)
    sink.close()


def open_keeping_last(options: SinkOptions) -> NullSink:
    return NullSink(options.size)


def test_a_sink_gets_a_picture_that_is_shown_again_as_the_same_array() -> None:
    output = SinkOutput(OutputOptions(SIZE, 30.0, "Relit Camera", sink=f"{__name__}:open_keeping_last"))
    memory = memoryview(bytearray(grey(1).tobytes()))
    seen = []
    for picture in (memory, memory, memory[:]):  # the last one lies in the same place, and is another one
        if picture is not memory:
            memory[:] = grey(2).tobytes()
        output.send(picture)
        seen.append(output._sink.last)
    assert seen[0] is seen[1]
    assert [int(image[0, 0, 0]) for image in seen] == [1, 1, 2]
