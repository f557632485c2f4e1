"""The threads of the libraries, and when garbage is collected."""

from __future__ import annotations

import gc

import cv2
import pytest

from relit_camera.base.concurrency.threads import freeze_gc, limit_threads, paused_gc


def test_opencv_has_one_thread() -> None:
    before = cv2.getNumThreads()
    try:
        limit_threads()
        assert cv2.getNumThreads() == 1
    finally:
        cv2.setNumThreads(before)


def test_garbage_is_collected_again_once_a_start_is_over() -> None:
    assert gc.isenabled()
    with paused_gc():
        assert not gc.isenabled()
        freeze_gc()
        assert gc.isenabled()
    with pytest.raises(ValueError, match="no start"), paused_gc():
        raise ValueError("no start")
    assert gc.isenabled()
    gc.unfreeze()
