"""Limits how many threads the libraries use, and how much freed memory the process keeps."""

from __future__ import annotations

import ctypes
import gc
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

OPENCV_THREADS = 1
"""The camera's own threads keep two cores at work. A second thread of OpenCV's would shorten a stage, but waking it and
waiting for it costs a third of a run of the face mesh network a picture."""
BLAS_THREADS = 1
"""OpenBLAS's threads spin while they wait: two of them save a millisecond on an idle machine, but cost thirty when a
call app uses the other core."""
MAX_WORKERS = 4
"""Threads of a `worker_pool` at most: each holds a block of its own in memory."""
_GLIBC = ctypes.CDLL(None) if "CS_GNU_LIBC_VERSION" in getattr(os, "confstr_names", ()) else None
_M_ARENA_MAX = -8
"""The parameter of mallopt(3)."""
LARGE_ALLOCATION_BYTES = 31 << 20
"""More than any array of a frame, and less than the 32 MB up to which glibc adapts its threshold."""


def limit_threads() -> None:
    """Limit the threads of OpenCV and BLAS for the whole process, and set how the C library keeps memory.

    Call it before threads start. The threads of ONNX Runtime are set in the options of each session.
    """
    cv2.setNumThreads(OPENCV_THREADS)
    threadpool_limits(limits=BLAS_THREADS, user_api="blas")
    share_freed_memory()
    retain_large_allocations()


@contextmanager
def worker_pool() -> Iterator[ThreadPoolExecutor]:
    """A pool of threads, one a core, for work on blocks of large arrays.

    NumPy and BLAS release the interpreter lock during such work. BLAS starts no threads of its own meanwhile.
    """
    count = min(os.cpu_count() or 1, MAX_WORKERS)
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(count) as pool:
        yield pool


def retain_large_allocations() -> None:
    """Make the C library keep freed arrays of a frame's size for the process.

    glibc returns every large block to the system when it is freed, and requests it again for the next frame, page by
    page: several milliseconds a frame. Freeing one block of `LARGE_ALLOCATION_BYTES` raises the size from which it does
    so (mallopt(3), M_MMAP_THRESHOLD). With other C libraries this has no effect.
    """
    block = np.empty(LARGE_ALLOCATION_BYTES, dtype=np.uint8)
    del block


def share_freed_memory() -> None:
    """Make all threads allocate from one heap, so that one takes what another has freed. Only with glibc.

    It gives each thread a heap of its own otherwise, and each keeps the arrays of a frame that were freed in it: a
    hundred megabytes with five threads. They allocate large blocks and few, so they do not wait for each other.
    """
    if _GLIBC is not None:
        _GLIBC.mallopt(_M_ARENA_MAX, 1)


def return_freed_memory() -> None:
    """Give freed memory back to the system, after work that needed much for a moment. Only with glibc."""
    if _GLIBC is not None:
        _GLIBC.malloc_trim(0)


def freeze_gc() -> None:
    """Exclude all present objects (modules, networks, the subject) from Python's garbage collection.

    A full collection then inspects newer objects only: it stops the camera for a millisecond instead of fifty.
    """
    gc.collect()
    gc.freeze()
    gc.collect()  # a full collection is due when new objects exceed a quarter of those left by the last: now none
