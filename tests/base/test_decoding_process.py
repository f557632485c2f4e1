"""Decoding in a process of its own: what it answers, and every way in which a file ends it."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest

from relit_camera.base.concurrency.decoding_process import Decoded, DecodingProcess
from relit_camera.base.errors import ImageError, InputError


def numbered(start: int) -> Decoded:
    array = np.arange(start, start + 2_000_000, dtype=np.float32).reshape(1000, 2000)
    return Decoded((array, np.array([1, 2, 3], np.uint8)), {"process": os.getpid(), "notes": ("a", "b")})


def refuse() -> Decoded:
    raise ImageError("the file is no picture", "choose another")


def fail() -> Decoded:
    raise ZeroDivisionError


def take_memory(count: int) -> Decoded:
    return Decoded((np.ones(count, np.uint8),))


def spin() -> Decoded:
    while True:
        pass


def sleep() -> Decoded:
    time.sleep(60)
    return Decoded()


def die() -> Decoded:
    os._exit(7)


@pytest.fixture
def process() -> Iterator[DecodingProcess]:
    one = DecodingProcess(most_bytes=512 << 20, cpu_limit_s=1, timeout_s=20)
    yield one
    one.close()


def test_arrays_and_facts_come_whole_from_one_other_process(process: DecodingProcess) -> None:
    first, second = process.decode(numbered, 3), process.decode(numbered, 5)
    np.testing.assert_array_equal(second.arrays[0], np.arange(5, 2_000_005).reshape(1000, 2000))
    np.testing.assert_array_equal(second.arrays[1], [1, 2, 3])
    assert [array.dtype for array in second.arrays] == [np.float32, np.uint8]
    assert second.facts["notes"] == ["a", "b"]
    assert first.facts["process"] == second.facts["process"] != os.getpid()


def test_an_error_with_a_cure_arrives_whole(process: DecodingProcess) -> None:
    with pytest.raises(ImageError, match="the file is no picture; choose another"):
        process.decode(refuse)


@pytest.mark.parametrize("harm", [fail, die, spin], ids=["an error that nobody expects", "death", "processor time"])
def test_a_file_that_ends_its_decoder_is_at_fault_and_the_next_is_decoded(
    process: DecodingProcess, harm: object
) -> None:
    assert callable(harm)
    with pytest.raises(InputError, match="memory or time") as caught:
        process.decode(harm)
    assert caught.value.cure
    assert process.decode(numbered, 0).arrays[0][0, 1] == 1


def test_memory_is_limited(process: DecodingProcess) -> None:
    with pytest.raises(InputError, match="too much memory"):
        process.decode(take_memory, 2 << 30)
    assert len(process.decode(take_memory, 10 << 20).arrays[0]) == 10 << 20


def test_time_is_limited() -> None:
    process = DecodingProcess(timeout_s=0.5)
    with pytest.raises(InputError, match="too much time"):
        process.decode(sleep)
    process.close()


def test_it_ends_when_nothing_comes_and_starts_again() -> None:
    process = DecodingProcess(idle_s=0.2)
    first = process.decode(numbered, 0).facts["process"]
    ended = time.monotonic() + 20
    while psutil.pid_exists(first):
        assert time.monotonic() < ended
        time.sleep(0.05)
    second = process.decode(numbered, 0).facts["process"]
    assert second != first
    process.close()
    assert not psutil.pid_exists(second)


def test_a_program_that_stops_does_not_wait_for_a_file(process: DecodingProcess) -> None:
    process.decode(numbered, 0)
    stopping = threading.Timer(0.3, process.interrupt)
    stopping.start()
    began = time.monotonic()
    with pytest.raises(InputError):
        process.decode(sleep)
    assert time.monotonic() - began < 10
    assert process.decode(numbered, 4).arrays[0][0, 0] == 4


def test_callers_wait_for_each_other(process: DecodingProcess) -> None:
    results: list[float] = []

    def ask(start: int) -> None:
        results.append(float(process.decode(numbered, start).arrays[0][0, 0]))

    threads = [threading.Thread(target=ask, args=(start,)) for start in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    assert sorted(results) == [0, 1, 2, 3, 4, 5]


def test_nothing_is_left_behind(process: DecodingProcess, tmp_path: Path) -> None:
    process.decode(numbered, 0)
    open_files = psutil.Process().num_fds()
    for _ in range(3):
        with pytest.raises(InputError):
            process.decode(die)
    process.decode(numbered, 0)
    assert psutil.Process().num_fds() == open_files
    assert list(tmp_path.iterdir()) == []
