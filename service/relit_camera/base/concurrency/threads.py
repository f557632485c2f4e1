"""Limits how many threads the libraries use, and when Python collects garbage."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import cv2
from threadpoolctl import threadpool_limits

from relit_camera.base.concurrency.resident_memory import retain_large_allocations, share_freed_memory

OPENCV_THREADS = 1
"""The camera's own threads keep two cores at work. A second thread of OpenCV's would shorten a stage, but waking it and
waiting for it costs a third of a run of the face mesh network a picture."""
BLAS_THREADS = 1
"""OpenBLAS's threads spin while they wait: two of them save a millisecond on an idle machine, but cost thirty when a
call app uses the other core."""
MAX_WORKERS = 4
"""Threads of a `worker_pool` at most: each holds a block of its own in memory."""


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


@contextmanager
def paused_gc() -> Iterator[None]:
    """Collect no garbage until `freeze_gc` is called, or the block ends.

    Nearly all that a start makes stays: looking through it for garbage again and again takes a tenth of a second.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def freeze_gc() -> None:
    """Exclude all present objects (modules, networks, the subject) from Python's garbage collection.

    A full collection then inspects newer objects only: it stops the camera for a millisecond instead of fifty.
    """
    gc.collect()
    gc.freeze()
    gc.collect()  # a full collection is due when new objects exceed a quarter of those left by the last: now none
    gc.enable()
