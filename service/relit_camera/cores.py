"""How the machine's cores are shared among the libraries that start threads of their own."""

from __future__ import annotations

import os

import cv2
from threadpoolctl import threadpool_limits

OPENCV_THREADS = 2
BLAS_THREADS = 1
"""OpenBLAS's threads spin while they wait: two of them gain a millisecond on an idle machine, and lose thirty when a
call app wants the other core."""


def share_cores() -> None:
    """Give OpenCV and BLAS an explicit share, for the whole process. ONNX Runtime's is in each session's options."""
    cv2.setNumThreads(min(os.cpu_count() or 1, OPENCV_THREADS))
    threadpool_limits(limits=BLAS_THREADS, user_api="blas")
