import threading
import time

from relit_camera.base.newest_slot import NewestSlot


def test_newest_wins_and_the_others_are_counted_as_dropped():
    slot: NewestSlot[str] = NewestSlot()
    reader = slot.reader()
    for value in "abc":
        slot.put(value)
    assert reader.get(0) == "c"
    assert reader.dropped == 2
    assert slot.count == 3


def test_a_value_is_got_once():
    slot: NewestSlot[int] = NewestSlot()
    reader = slot.reader()
    slot.put(1)
    assert reader.get(0) == 1
    start = time.monotonic()
    assert reader.get(0.05) is None
    assert time.monotonic() - start >= 0.045


def test_every_reader_gets_the_newest():
    slot: NewestSlot[int] = NewestSlot()
    early, other = slot.reader(), slot.reader()
    slot.put(1)
    assert early.get(0) == 1
    slot.put(2)
    late = slot.reader()
    assert (early.get(0), other.get(0), late.get(0)) == (2, 2, 2)
    assert (early.dropped, other.dropped, late.dropped) == (0, 1, 0)


def test_get_wakes_up_when_a_value_comes():
    slot: NewestSlot[int] = NewestSlot()
    timer = threading.Timer(0.05, slot.put, [7])
    timer.start()
    start = time.monotonic()
    assert slot.reader().get(5) == 7
    assert time.monotonic() - start < 2
    timer.join()


def test_put_at_is_when_it_was_put():
    slot: NewestSlot[int] = NewestSlot()
    reader = slot.reader()
    before = time.monotonic()
    slot.put(1)
    after = time.monotonic()
    time.sleep(0.02)
    reader.get(0)
    assert before <= reader.put_at <= after


def test_newer_answers_by_number():
    slot: NewestSlot[str] = NewestSlot()
    slot.put("a")
    slot.put("b")
    found = slot.newer(1, 0)
    assert found is not None
    assert found[:2] == (2, "b")
    assert slot.newer(2, 0) is None


def test_close_wakes_readers_gives_the_last_value_and_takes_no_more():
    slot: NewestSlot[int] = NewestSlot()
    waiting = slot.reader()
    threading.Timer(0.05, slot.close).start()
    start = time.monotonic()
    assert waiting.get(10) is None
    assert time.monotonic() - start < 5

    slot = NewestSlot()
    unread = slot.reader()
    slot.put(1)
    slot.close()
    slot.put(2)
    assert unread.get(0) == 1
    assert unread.get(10) is None


def test_nothing_is_lost_or_doubled_between_threads():
    slot: NewestSlot[int] = NewestSlot()
    readers = [slot.reader() for _ in range(3)]
    seen: list[list[int]] = [[] for _ in readers]

    def read(number: int) -> None:
        while (value := readers[number].get(5)) is not None:
            seen[number].append(value)

    threads = [threading.Thread(target=read, args=[number]) for number in range(len(readers))]
    for thread in threads:
        thread.start()
    for value in range(2000):
        slot.put(value)
    slot.close()
    for thread in threads:
        thread.join(10)
    for values, reader in zip(seen, readers, strict=True):
        assert values == sorted(set(values))
        assert values[-1] == 1999
        assert len(values) + reader.dropped == 2000
