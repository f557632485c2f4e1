"""How much freed memory the process keeps, in processes of their own; and the threads of the libraries."""

from __future__ import annotations

import subprocess
import sys

import cv2
import pytest

from relit_camera.base.concurrency import threads
from relit_camera.base.concurrency.threads import limit_threads

pytestmark = pytest.mark.skipif(threads._GLIBC is None, reason="another C library than glibc")

FREED_IN_FOUR_THREADS = """
import sys, threading
import numpy as np, psutil
from relit_camera.base.concurrency.threads import retain_large_allocations, return_freed_memory, share_freed_memory
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


def test_a_thread_takes_what_another_has_freed() -> None:
    assert kept_mib("shared")[0] < 40
    assert kept_mib("apart")[0] > 70  # else glibc needs no telling any more


def test_freed_memory_is_returned() -> None:
    before, after = kept_mib("shared")
    assert after < 10 < before


def test_opencv_has_one_thread() -> None:
    before = cv2.getNumThreads()
    try:
        limit_threads()
        assert cv2.getNumThreads() == 1
    finally:
        cv2.setNumThreads(before)
