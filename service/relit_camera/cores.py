"""How the machine's cores are shared among the libraries that start threads of their own."""

from __future__ import annotations

import os

import cv2
from threadpoolctl import threadpool_limits

MOST_USEFUL = 2
"""Threads beyond this do not make a frame of this size faster: they only make the machine hot."""


def share_cores() -> None:
    """Give OpenCV and BLAS an explicit share, for the whole process. ONNX Runtime's is in each session's options."""
    threads = min(os.cpu_count() or 1, MOST_USEFUL)
    cv2.setNumThreads(threads)
    threadpool_limits(limits=threads)
