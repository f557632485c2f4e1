"""How much memory the process keeps that it does not need, in processes of their own."""

from __future__ import annotations

import subprocess
import sys

import pytest

from relit_camera.base.concurrency import resident_memory
from tests.virtual_clock import VirtualClock

pytestmark = pytest.mark.skipif(resident_memory._GLIBC is None, reason="another C library than glibc")

FREED_IN_FOUR_THREADS = """
import sys, threading
import numpy as np, psutil
from relit_camera.base.concurrency.resident_memory import (
    retain_large_allocations, return_freed_memory, share_freed_memory
)
if sys.argv[1] == "shared":
    share_freed_memory()
retain_large_allocations()
before = psutil.Process().memory_info().rss
ends = [threading.Event() for _ in range(4)]
def work(end):
    for _ in range(3):
        np.ones(24 << 20, np.uint8)
    done.release()
    end.wait()
done = threading.Semaphore(0)
for end in ends:
    threading.Thread(target=work, args=(end,)).start()
    done.acquire()
print((psutil.Process().memory_info().rss - before) >> 20)
return_freed_memory()
print((psutil.Process().memory_info().rss - before) >> 20)
for end in ends:
    end.set()
"""


def kept_mib(how: str) -> list[int]:
    command = [sys.executable, "-c", FREED_IN_FOUR_THREADS, how]
    return [int(line) for line in subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()]


@pytest.mark.slow
def test_a_thread_takes_what_another_has_freed() -> None:
    assert kept_mib("shared")[0] < 40
    assert kept_mib("apart")[0] > 70  # else glibc needs no telling any more


def test_freed_memory_is_returned() -> None:
    before, after = kept_mib("shared")
    assert after < 10 < before


PAGES_TAKEN_BY_LARGE_BLOCKS = """
import resource
import numpy as np
from relit_camera.base.concurrency.resident_memory import large_allocations_apart, retain_large_allocations
def taken():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        np.ones(3 << 20, np.uint8)
    return (resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before) // 20
retain_large_allocations()
taken()
print(taken())
with large_allocations_apart():
    print(taken())
    with large_allocations_apart():
        pass
    print(taken())
taken()
print(taken())
"""


def test_large_blocks_are_apart_while_something_is_opened_and_retained_afterwards() -> None:
    command = [sys.executable, "-c", PAGES_TAKEN_BY_LARGE_BLOCKS]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    before, opening, still_opening, after = map(int, done.stdout.split())
    assert opening > 500 < still_opening  # 768 pages a block
    assert before < 50 > after


LIBRARY_PAGES = """
import re
import cv2, numpy as np
from relit_camera.base.concurrency.resident_memory import drop_library_pages
def resident_mb():
    return sum(int(kb) for kb in re.findall(r"RssFile:\\s+(\\d+)", open("/proc/self/status").read())) >> 10
picture = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
before, seen = cv2.GaussianBlur(picture, (0, 0), 3), resident_mb()
drop_library_pages()
print(seen - resident_mb())
assert (cv2.GaussianBlur(picture, (0, 0), 3) == before).all()
assert cv2.imdecode(cv2.imencode(".png", picture)[1], 1).shape == picture.shape
"""


def test_library_pages_go_and_come_back() -> None:
    done = subprocess.run([sys.executable, "-c", LIBRARY_PAGES], check=True, capture_output=True, text=True)
    assert int(done.stdout) > 10


SMAPS = """\
7f00-7f10 r--p 00000000 00:1f 12 /lib/libx.so.1.2
Rss:                  64 kB
Anonymous:             0 kB
Swap:                  0 kB
7f10-7f40 r-xp 00010000 00:1f 12 /lib/libx.so.1.2
Anonymous:             0 kB
Swap:                  0 kB
VmFlags: rd ex mr mw me sd
7f40-7f50 r--p 00040000 00:1f 12 /lib/libx.so.1.2
Anonymous:             8 kB
Swap:                  0 kB
7f50-7f60 r--p 00050000 00:1f 12 /lib/liby.so
Anonymous:             0 kB
Swap:                  4 kB
7f60-7f70 rw-p 00060000 00:1f 12 /lib/liby.so
Anonymous:             0 kB
Swap:                  0 kB
7f70-7f80 r--p 00000000 00:1f 13 /home/somebody/film.sorted
Anonymous:             0 kB
Swap:                  0 kB
7f80-7f90 r-xp 00000000 00:00 0
Anonymous:             0 kB
Swap:                  0 kB
"""


def test_nothing_that_was_written_is_dropped() -> None:
    found = resident_memory._unwritten_library_mappings(SMAPS)
    assert list(found) == [(0x7F10, 0x7F40)]


def test_freed_memory_is_given_back_when_the_process_has_grown() -> None:
    mib = resident_memory.GROWN_BYTES // 12
    resident, given_back = [200 * mib], list[int]()

    def give_back() -> None:
        given_back.append(resident[0] // mib)
        resident[0] -= 30 * mib

    clock = VirtualClock()
    returned = resident_memory.FreedMemoryReturn(lambda: resident[0], give_back, clock)
    for grown_to in (200, 190, 201, 202, 190, 201, 150, 161, 162):
        resident[0] = grown_to * mib
        clock.sleep(resident_memory.GIVEN_BACK_S)
        returned.check()
    # At first; 202 is 12 above 190, where the frames in work had their arrays again; it fell to 150 by itself.
    assert given_back == [200, 202, 162]
    resident[0] = 300 * mib
    returned.check()
    assert len(given_back) == 3, "not so soon again: it holds every thread up"


def test_what_the_frames_in_work_take_again_is_no_growth() -> None:
    mib = resident_memory.GROWN_BYTES // 12
    resident, given_back = [200 * mib], list[float]()
    clock = VirtualClock()

    def give_back() -> None:
        given_back.append(clock.now())
        resident[0] = 150 * mib

    returned = resident_memory.FreedMemoryReturn(lambda: resident[0], give_back, clock)
    returned.check()
    for _ in range(60):
        clock.sleep(1.0)
        resident[0] = min(resident[0] + 20 * mib, 200 * mib)
        returned.check()
    assert len(given_back) == 1
