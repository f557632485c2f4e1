"""Decoding in a process of its own: what it answers, and every way in which a file ends it."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from multiprocessing.context import SpawnProcess
from pathlib import Path

import numpy as np
import psutil
import pytest

from relit_camera.base.concurrency.decoding_process import Decoded, DecodingProcess
from relit_camera.base.errors import ImageError, InputError, NotReadyError
from tests.base.decoders import checked, die, fail, numbered, refuse, refuse_for_memory, sleep, spin, take_memory


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


@pytest.mark.slow
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


@pytest.mark.slow
def test_time_is_limited() -> None:
    process = DecodingProcess(timeout_s=0.5)
    with pytest.raises(InputError, match="too much time"):
        process.decode(sleep)
    process.close()


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_program_that_stops_does_not_wait_for_a_file(process: DecodingProcess) -> None:
    process.decode(numbered, 0)
    stopping = threading.Timer(0.3, process.interrupt)
    stopping.start()
    with pytest.raises(NotReadyError, match="the program stops"):  # and not that the file takes too much time
        process.decode(sleep)
    assert process.decode(numbered, 4).arrays[0][0, 0] == 4


@pytest.mark.slow
def test_a_program_that_stops_starts_no_worker_for_those_who_wait(process: DecodingProcess) -> None:
    process.decode(numbered, 0)
    told: list[str] = []

    def ask(work: Callable[[], Decoded]) -> None:
        with pytest.raises(NotReadyError) as caught:
            process.decode(work)
        told.append(caught.value.what)

    threads = [threading.Thread(target=ask, args=(work,)) for work in (sleep, spin, spin)]
    for thread in threads:
        thread.start()
    time.sleep(0.5)
    process.interrupt()
    for thread in threads:
        thread.join(10)
    assert told == ["the program stops"] * 3


def test_a_stop_while_the_worker_starts_ends_it(process: DecodingProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    start = SpawnProcess.start

    def interrupted(self: SpawnProcess) -> None:
        process.interrupt()
        start(self)
        process.interrupt()

    with monkeypatch.context() as patched:
        patched.setattr(SpawnProcess, "start", interrupted)
        with pytest.raises(NotReadyError, match="the program stops"):
            process.decode(numbered, 0)
    assert process.decode(numbered, 4).arrays[0][0, 0] == 4


def test_the_wait_for_other_files_is_bounded() -> None:
    process = DecodingProcess(timeout_s=20, wait_s=0.1)
    process.decode(numbered, 0)

    def keep_busy() -> None:
        with pytest.raises(NotReadyError):
            process.decode(sleep)

    busy = threading.Thread(target=keep_busy)
    busy.start()
    time.sleep(0.3)
    with pytest.raises(NotReadyError, match="other files are being decoded"):
        process.decode(numbered, 0)
    process.interrupt()
    busy.join(10)
    process.close()


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is limited on Linux")
@pytest.mark.parametrize("harm", ["numpy", "cause", "death"])
def test_little_free_memory_is_not_told_as_a_harmful_file(harm: str) -> None:
    process = DecodingProcess(most_bytes=1 << 60)  # more than is free
    harms = {"numpy": (take_memory, 1 << 50), "cause": (refuse_for_memory,), "death": (die,)}
    with pytest.raises(NotReadyError, match="too little free memory") as caught:
        process.decode(*harms[harm])  # type: ignore[arg-type]
    assert "close other programs" in caught.value.cure
    with pytest.raises(ImageError):
        process.decode(refuse)
    process.close()


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


@pytest.mark.slow
def test_nothing_is_left_behind(process: DecodingProcess, tmp_path: Path) -> None:
    process.decode(numbered, 0)
    open_files = psutil.Process().num_fds()
    for _ in range(3):
        with pytest.raises(InputError):
            process.decode(die)
    process.decode(numbered, 0)
    assert psutil.Process().num_fds() == open_files
    assert list(tmp_path.iterdir()) == []


def test_the_process_goes_on_after_an_answer_without_arrays(process: DecodingProcess) -> None:
    first = process.decode(checked).facts["process"]
    assert process.decode(checked).facts["process"] == first
