"""PODs without PipeWire: the bytes that its documentation describes, and what cannot be read."""

from __future__ import annotations

import contextlib
import struct
import sys
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from relit_camera.devices.sinks.pipewire.camera_formats import (
    BGRX,
    BUFFERS,
    COLOR_MATRIX,
    I420,
    STRIDE,
    VIDEO_FORMAT,
    VIDEO_FRAME_RATE,
    VIDEO_SIZE,
    YUY2,
    PixelLayout,
    buffer_params,
    chosen_layout,
    format_params,
    offered_layouts,
)
from relit_camera.devices.sinks.pipewire.spa_pods import (
    ChoiceType,
    Pod,
    choice_pod,
    fraction_pod,
    id_pod,
    int_pod,
    object_pod,
    read_object,
    rectangle_pod,
)

SIZE = (320, 180)
little_endian = pytest.mark.skipif(sys.byteorder != "little", reason="the expected bytes are little-endian")


@little_endian
def test_an_integer_is_padded_to_eight_bytes() -> None:
    assert int_pod(-2).encode() == bytes.fromhex("04000000 04000000 feffffff 00000000")
    assert id_pod(7).encode() == bytes.fromhex("04000000 03000000 07000000 00000000")


@little_endian
def test_pairs() -> None:
    assert rectangle_pod(320, 180).encode() == bytes.fromhex("08000000 0a000000 40010000 b4000000")
    assert fraction_pod(Fraction(30)).encode() == bytes.fromhex("08000000 0b000000 1e000000 01000000")


@little_endian
def test_a_choice_has_the_header_of_one_value_and_all_values_without() -> None:
    assert choice_pod(ChoiceType.RANGE, int_pod(4), int_pod(2), int_pod(8)).encode() == bytes.fromhex(
        "1c000000 13000000"  # size 28, a choice
        "01000000 00000000"  # of a range, no flags
        "04000000 04000000"  # each four bytes, an integer
        "04000000 02000000 08000000 00000000"  # and padding
    )


@little_endian
def test_an_object_has_type_number_and_properties() -> None:
    assert object_pod(0x40003, 3, {1: id_pod(2)}).encode() == bytes.fromhex(
        "20000000 0f000000 03000400 03000000 01000000 00000000 04000000 03000000 02000000 00000000"
    )


def test_what_is_written_can_be_read() -> None:
    written = {1: id_pod(2), 0x20003: rectangle_pod(4, 6), 9: choice_pod(ChoiceType.NONE, int_pod(5))}
    found = read_object(object_pod(0x40003, 4, written).encode())
    assert (found[1].number, found[0x20003].pair, found[9].number) == (2, (4, 6), 5)


@pytest.mark.parametrize(
    "data",
    [b"", b"\0" * 4, int_pod(3).encode(), object_pod(1, 2, {3: int_pod(4)}).encode()[:-4], struct.pack("=II", 99, 15)],
)
def test_what_is_no_whole_object_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"cut off|no object"):
        read_object(data)


@given(st.binary(max_size=200))
def test_other_bytes_are_read_or_refused(data: bytes) -> None:
    with contextlib.suppress(ValueError):
        read_object(struct.pack("=II", len(data), 15) + data)


def test_numbers_and_pairs_are_told_apart() -> None:
    with pytest.raises(ValueError, match="no number"):
        _ = rectangle_pod(1, 2).number
    with pytest.raises(ValueError, match="no pair"):
        _ = int_pod(1).pair
    with pytest.raises(ValueError, match="no number"):
        _ = Pod(4, b"\0").number


def test_both_layouts_are_offered_in_one_size_and_rate() -> None:
    first, second = map(read_object, format_params(SIZE, 30.0))
    assert [found[VIDEO_FORMAT].number for found in (first, second)] == [I420.identifier, BGRX.identifier]
    assert first[VIDEO_SIZE].pair == second[VIDEO_SIZE].pair == SIZE
    assert first[VIDEO_FRAME_RATE].pair == (30, 1)
    assert (first[COLOR_MATRIX].number, second[COLOR_MATRIX].number) == (4, 1)


def test_a_rate_of_television_is_told_exactly() -> None:
    (first, _) = map(read_object, format_params(SIZE, 30000 / 1001))
    assert first[VIDEO_FRAME_RATE].pair == (30000, 1001)


def test_where_readers_disagree_on_planes_pixels_lie_in_one() -> None:
    assert offered_layouts((854, 480)) == (YUY2, BGRX)
    assert offered_layouts((856, 480)) == (I420, BGRX)


@pytest.mark.parametrize(
    ("layout", "stride", "size"), [(I420, 320, 86_400), (YUY2, 640, 115_200), (BGRX, 1280, 230_400)]
)
def test_buffers_fit_the_layout(layout: PixelLayout, stride: int, size: int) -> None:
    found, meta = map(read_object, buffer_params(layout, SIZE))
    assert (found[BUFFERS].number, found[STRIDE].number, found[3].number) == (4, stride, size)
    assert meta[2].number == 32  # the header's bytes: two numbers of four, three of eight


def test_the_chosen_layout_is_one_of_those_offered() -> None:
    params = format_params(SIZE, 30.0)
    assert [chosen_layout(param, SIZE) for param in params] == [I420, BGRX]
    with pytest.raises(ValueError, match="size"):
        chosen_layout(params[0], (640, 360))
    with pytest.raises(ValueError, match="layout 99"):
        chosen_layout(
            object_pod(0x40003, 4, {VIDEO_FORMAT: id_pod(99), VIDEO_SIZE: rectangle_pod(*SIZE)}).encode(), SIZE
        )
    with pytest.raises(ValueError, match="without"):
        chosen_layout(object_pod(0x40003, 4, {}).encode(), SIZE)
