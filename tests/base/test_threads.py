"""The threads of the libraries."""

from __future__ import annotations

import cv2

from relit_camera.base.concurrency.threads import limit_threads


def test_opencv_has_one_thread() -> None:
    before = cv2.getNumThreads()
    try:
        limit_threads()
        assert cv2.getNumThreads() == 1
    finally:
        cv2.setNumThreads(before)
