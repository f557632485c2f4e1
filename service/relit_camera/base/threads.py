"""How this process uses the machine: threads of the libraries that start their own, and memory of pictures."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

OPENCV_THREADS = 2
BLAS_THREADS = 1
"""OpenBLAS's threads spin while they wait: two of them gain a millisecond on an idle machine, and lose thirty when a
call app wants the other core."""
MAX_WORKERS = 4
"""Each holds a block of its own in memory."""
LARGE_ALLOCATION_BYTES = 31 << 20
"""More than any array of a frame, and less than the 32 MB up to which glibc adapts."""


def limit_threads() -> None:
    """Give OpenCV and BLAS an explicit share, for the whole process; ONNX Runtime's is in each session's options.

    And keep the memory of pictures.
    """
    cv2.setNumThreads(min(os.cpu_count() or 1, OPENCV_THREADS))
    threadpool_limits(limits=BLAS_THREADS, user_api="blas")
    retain_large_allocations()


@contextmanager
def worker_pool() -> Iterator[ThreadPoolExecutor]:
    """Threads, one a core, for work on blocks of large arrays: NumPy and BLAS let go of Python's lock meanwhile.

    BLAS starts no threads of its own under them.
    """
    count = min(os.cpu_count() or 1, MAX_WORKERS)
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(count) as pool:
        yield pool


def retain_large_allocations() -> None:
    """Let freed arrays of a frame's size stay with the process.

    glibc gives every large block back to the system and takes it again for the next frame, page by page: several
    milliseconds a frame. Freeing one such block raises the size from which it does so (mallopt(3), M_MMAP_THRESHOLD).
    Elsewhere it does nothing.
    """
    block = np.empty(LARGE_ALLOCATION_BYTES, dtype=np.uint8)
    del block


def freeze_gc() -> None:
    """Tell Python's garbage collector that all there is now stays: modules, networks, the subject.

    A collection then looks at what came since: it holds the camera up for a millisecond, not for fifty.
    """
    gc.collect()
    gc.freeze()
    gc.collect()  # the next full one comes once there are a quarter as many new objects as this one leaves: none
