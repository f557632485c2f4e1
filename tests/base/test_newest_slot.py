"""The slot for the newest value: alone in virtual time, and between threads."""

from __future__ import annotations

import threading

from relit_camera.base.concurrency.newest_slot import NewestSlot
from tests.virtual_clock import VirtualClock

LONG_S = 60.0


def test_newest_wins_and_the_others_are_counted_as_dropped() -> None:
    slot: NewestSlot[str] = NewestSlot()
    reader = slot.reader()
    for value in "abc":
        slot.put(value)
    assert reader.get(0) == "c"
    assert reader.dropped == 2
    assert slot.count == 3


def test_a_value_is_got_once_and_the_next_waited_for() -> None:
    clock = VirtualClock()
    slot: NewestSlot[int] = NewestSlot(clock)
    reader = slot.reader()
    slot.put(1)
    assert reader.get(0) == 1
    start = clock.now()
    assert reader.get(0.05) is None
    assert clock.now() == start + 0.05


def test_every_reader_gets_the_newest() -> None:
    slot: NewestSlot[int] = NewestSlot()
    early, other = slot.reader(), slot.reader()
    slot.put(1)
    assert early.get(0) == 1
    slot.put(2)
    late = slot.reader()
    assert (early.get(0), other.get(0), late.get(0)) == (2, 2, 2)
    assert (early.dropped, other.dropped, late.dropped) == (0, 1, 0)


def test_put_at_is_when_it_was_put() -> None:
    clock = VirtualClock()
    slot: NewestSlot[int] = NewestSlot(clock)
    reader = slot.reader()
    slot.put(1)
    put_at = clock.now()
    clock.sleep(0.5)
    reader.get(0)
    assert reader.put_at == put_at


def test_get_returns_as_soon_as_a_value_comes() -> None:
    clock = VirtualClock()
    slot: NewestSlot[int] = NewestSlot(clock)
    start = clock.now()
    clock.at(0.05, lambda: slot.put(7))
    assert slot.reader().get(LONG_S) == 7
    assert clock.now() == start + 0.05


def test_newer_answers_by_number() -> None:
    slot: NewestSlot[str] = NewestSlot()
    slot.put("a")
    slot.put("b")
    found = slot.newer(1, 0)
    assert found is not None
    assert found[:2] == (2, "b")
    assert slot.newer(2, 0) is None


def test_close_wakes_readers_gives_the_last_value_and_takes_no_more() -> None:
    clock = VirtualClock()
    slot: NewestSlot[int] = NewestSlot(clock)
    start = clock.now()
    clock.at(0.05, slot.close)
    assert slot.reader().get(LONG_S) is None
    assert clock.now() == start + 0.05

    slot = NewestSlot(clock)
    unread = slot.reader()
    slot.put(1)
    slot.close()
    slot.put(2)
    assert unread.get(0) == 1
    assert unread.get(LONG_S) is None
    assert clock.now() == start + 0.05  # at once


# Between threads.


def test_a_thread_that_waits_is_woken_by_a_value_and_by_closing() -> None:
    slot: NewestSlot[int] = NewestSlot()
    reader, got = slot.reader(), list[int | None]()

    def read() -> None:
        got.append(reader.get(LONG_S))
        got.append(reader.get(LONG_S))

    thread = threading.Thread(target=read)
    thread.start()
    slot.put(7)
    slot.close()
    thread.join(LONG_S / 2)
    assert got == [7, None]


def test_nothing_is_lost_or_doubled_between_threads() -> None:
    slot: NewestSlot[int] = NewestSlot()
    readers = [slot.reader() for _ in range(3)]
    seen: list[list[int]] = [[] for _ in readers]

    def read(number: int) -> None:
        while (value := readers[number].get(LONG_S)) is not None:
            seen[number].append(value)

    threads = [threading.Thread(target=read, args=[number]) for number in range(len(readers))]
    for thread in threads:
        thread.start()
    for value in range(2000):
        slot.put(value)
    slot.close()
    for thread in threads:
        thread.join(LONG_S / 2)
    for values, reader in zip(seen, readers, strict=True):
        assert values == sorted(set(values))
        assert values[-1] == 1999
        assert len(values) + reader.dropped == 2000
