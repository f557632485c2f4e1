"""When it is said that the computer does not keep up, and what is advised."""

from __future__ import annotations

import pytest

from relit_camera.live.status.speed_advice import DEFAULT_LIMITS, SpeedState, next_speed, reduced_quality, speed_advice


def behind_after(*looks: tuple[float, float]) -> list[bool]:
    """Whether it is said after each look: seconds since the one before, and pictures a second of thirty."""
    state, now, said = SpeedState(), 1000.0, []
    for pause, new_fps in looks:
        now += pause
        state = next_speed(state, now, 30.0, new_fps)
        said.append(state.behind)
    return said


def test_it_is_said_after_five_seconds_and_taken_back_after_five() -> None:
    assert behind_after(*[(1.0, 15.0)] * 8) == [False] * 5 + [True] * 3
    assert behind_after(*[(1.0, 15.0)] * 6, *[(1.0, 30.0)] * 8) == [False] * 5 + [True] * 6 + [False] * 3


def test_a_short_stutter_is_not_told() -> None:
    looks = ([(1.0, 10.0)] * 4 + [(1.0, 30.0)]) * 10
    assert not any(behind_after(*looks))


def test_most_of_the_pictures_are_enough() -> None:
    assert not any(behind_after(*[(1.0, 25.0)] * 20))


def test_after_a_long_pause_it_is_looked_at_anew() -> None:
    assert behind_after((1.0, 10.0), (DEFAULT_LIMITS.gap_s + 1, 10.0), (4.0, 10.0), (1.0, 10.0)) == [
        False,
        False,
        False,
        True,
    ]


def test_where_no_pictures_are_expected_nothing_is_late() -> None:
    state = SpeedState()
    for now in range(20):
        state = next_speed(state, float(now), 0.0, 0.0)
    assert not state.behind


@pytest.mark.parametrize(
    ("size", "advised"),
    [
        ((1920, 1080), (1280, 720)),
        ((1280, 720), (960, 540)),
        ((960, 540), (640, 360)),
        ((640, 480), (640, 360)),
        ((480, 270), (480, 270)),
        ((128, 96), (128, 96)),
    ],
)
def test_the_next_smaller_size_is_advised(size: tuple[int, int], advised: tuple[int, int]) -> None:
    advice = speed_advice(size, 30.0, 12.4)
    assert (advice.width, advice.height) == advised
    assert advice.what == "the computer makes 12 of 30 pictures a second"
    assert ("try" in advice.cure) == (advised != size)


@pytest.mark.parametrize("size", [(1920, 1080), (640, 360), (480, 270)])
def test_a_busy_computer_is_told_what_the_advice_says(size: tuple[int, int]) -> None:
    cure = reduced_quality(0.2, size).cure
    assert cure.startswith(speed_advice(size, 30, 10).cure)
    assert f"{size[0]}x{size[1]}" not in cure
