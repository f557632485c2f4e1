"""How much memory the process keeps that it does not need now: freed blocks, and pages of the libraries' files."""

from __future__ import annotations

import ctypes
import gc
import os
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from relit_camera.base.concurrency.clock import SYSTEM_CLOCK, Clock

_GLIBC = ctypes.CDLL(None) if "CS_GNU_LIBC_VERSION" in getattr(os, "confstr_names", ()) else None
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
"""Parameters of mallopt(3)."""
_MADV_DONTNEED = 4
"""Of madvise(2)."""
RETAINED_BYTES = 32 << 20
"""More than any array of a frame, and the most that glibc takes."""
GROWN_BYTES = 12 << 20
"""More than a steady camera's memory goes up and down."""
GIVEN_BACK_S = 4.0
SETTLED_S = 2.0
"""So long after that the frames in work have their arrays again."""
APART_BYTES = 1 << 20
"""Every block apart is made of new pages, which the system must empty: with glibc's own 128 KiB that was 0.3 s of the
start, most of it for arrays of a moment, and resident memory came out the same (294 to 302 MB with either)."""

_apart_lock = threading.Lock()
_contexts_apart = 0
_to_be_tidied = False


def retain_large_allocations() -> None:
    """Make the C library keep freed arrays of a frame's size for the process. Only with glibc.

    It returns every large block to the system when it is freed, and requests it again for the next frame, page by page:
    several milliseconds a frame.
    """
    _set_thresholds(RETAINED_BYTES, 2 * RETAINED_BYTES)


@contextmanager
def large_allocations_apart(tidied: bool = True) -> Iterator[None]:
    """While the context lasts, keep large blocks outside of the heap, and return freed ones at once. Only with glibc.

    For what is opened: files are unpacked and networks loaded in large blocks, most of them for a moment. In the heap
    they would leave gaps between what stays, which the arrays of frames then spread over. At the end of the last such
    context, whichever thread it is in, blocks are retained again.

    Args:
        tidied: whether freed memory and the pages of libraries are given back at its end, which takes some
            milliseconds: for what is opened seldom.
    """
    global _contexts_apart, _to_be_tidied
    with _apart_lock:
        _contexts_apart += 1
        _set_thresholds(APART_BYTES, APART_BYTES)
    try:
        yield
    finally:
        with _apart_lock:
            _contexts_apart -= 1
            _to_be_tidied |= tidied
            if not _contexts_apart:
                if _to_be_tidied:
                    return_freed_memory()
                retain_large_allocations()
                if _to_be_tidied:
                    drop_library_pages()
                _to_be_tidied = False


def _set_thresholds(apart_bytes: int, trimmed_bytes: int) -> None:
    """Sizes from which a block is outside of the heap, and from which the heap's free end is returned."""
    if _GLIBC is not None:
        _GLIBC.mallopt(_M_MMAP_THRESHOLD, apart_bytes)
        _GLIBC.mallopt(_M_TRIM_THRESHOLD, trimmed_bytes)


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


def return_unused_memory() -> None:
    """Collect what only reference cycles hold, such as the networks of a pipeline that was replaced, and give it back.

    Python itself looks for old objects only when many new ones have come, which takes a running camera hours.
    """
    gc.collect()
    return_freed_memory()


class FreedMemoryReturn:
    """Gives unused memory back to the system when the process has grown; `check` is to be called regularly.

    What files and pictures took for a moment leaves gaps between what stays, which the process would keep. To give them
    back holds every thread up for some milliseconds, so it is done only where there may be much of it.
    """

    def __init__(
        self,
        resident: Callable[[], int],
        give_back: Callable[[], object] = return_unused_memory,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        """Set up.

        Args:
            resident: tells the process's resident memory in bytes.
            give_back: gives unused memory back; not more often than every `GIVEN_BACK_S`.
            clock: to measure by.
        """
        self._resident, self._give_back, self._clock = resident, give_back, clock
        self._least = 0.0
        self._not_before = self._settled_at = -float("inf")

    def check(self) -> None:
        """Give unused memory back where `GROWN_BYTES` more are resident than at some time since it was done last."""
        at = self._clock.now()
        if at < self._settled_at:
            return
        now = self._resident()
        if now - self._least >= GROWN_BYTES and at >= self._not_before:
            self._give_back()
            self._not_before, self._settled_at = at + GIVEN_BACK_S, at + SETTLED_S
            self._least = float("inf")
        else:
            self._least = min(now, self._least)


def drop_library_pages() -> None:
    """Let go of the pages of the libraries' files; what is still needed comes back as it is used. Only with glibc.

    Half of them were needed only while modules were imported and networks opened. Nothing that was written is lost:
    only machine code is chosen, of which no page was written to. The libraries' constants are not: a library that
    another thread opens at this moment has read-only pages that the loader is about to replace by ones it writes to.
    """
    if _GLIBC is not None:
        with suppress(OSError):  # no /proc
            for start, end in _unwritten_library_mappings(Path("/proc/self/smaps").read_text()):
                _GLIBC.madvise(ctypes.c_void_p(start), ctypes.c_size_t(end - start), _MADV_DONTNEED)


def _unwritten_library_mappings(smaps: str) -> Iterator[tuple[int, int]]:
    """First address and end of the libraries' private mappings of machine code without pages of their own (proc(5)).

    Of libraries alone: another file might be unmapped meanwhile, and its addresses be memory of another kind.
    """
    # A mapping's first line is the only one that begins with a digit or a small letter.
    for mapping in re.split(r"\n(?=[0-9a-f])", smaps):
        first, _, fields = mapping.partition("\n")
        found = re.match(r"([0-9a-f]+)-([0-9a-f]+) r-xp [0-9a-f]+ \S+ \d+ +/.*\.so[.0-9]*$", first)
        if found and all(re.search(rf"^{name}: +0 kB$", fields, re.MULTILINE) for name in ("Anonymous", "Swap")):
            yield int(found[1], 16), int(found[2], 16)
