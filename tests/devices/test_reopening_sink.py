"""A sink whose device comes later, and one whose settings are wrong."""

from __future__ import annotations

import numpy as np
import pytest

from relit_camera.base.errors import DeviceError, InputError
from relit_camera.devices.sinks.reopening_sink import ReopeningSink
from relit_camera.devices.sinks.sink import NullSink, Sink, SinkInfo

SIZE = (4, 2)
PICTURE = np.zeros((2, 4, 3), np.uint8)


class Module:
    """Makes a sink once it is loaded."""

    def __init__(self) -> None:
        self.loaded = False
        self.sink = NullSink(SIZE)

    def __call__(self) -> Sink:
        if not self.loaded:
            raise DeviceError("the module is not loaded", "load it")
        return self.sink


def test_it_opens_with_the_first_write_for_which_the_device_is_there() -> None:
    module = Module()
    sink = ReopeningSink(module, SIZE)
    assert str(sink.opening_error) == "the module is not loaded; load it"
    assert sink.describe() == SinkInfo("camera", "", SIZE)
    for _ in range(2):
        with pytest.raises(DeviceError, match="the module is not loaded"):
            sink.write(PICTURE)
    sink.close()
    module.loaded = True
    sink.write(PICTURE)
    sink.write(PICTURE)
    assert module.sink.count == 2
    assert sink.describe() == module.sink.describe()


def test_one_that_is_there_is_opened_at_once() -> None:
    module = Module()
    module.loaded = True
    sink = ReopeningSink(module, SIZE)
    assert sink.opening_error is None
    assert sink.describe().kind == "null"


def test_wrong_settings_are_an_error_at_once() -> None:
    def wrong() -> Sink:
        raise InputError("unknown sink 'x'", "use camera")

    with pytest.raises(InputError):
        ReopeningSink(wrong, SIZE)
