"""What the long run by hand judges, on runs made up here."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.soak import Sample, main, report

SECONDS = 600.0


def run(
    rss_mib: Callable[[float], float],
    p50_ms: Callable[[float], float],
    until_s: float = SECONDS,
    files: Callable[[float], float] = lambda _: 40,
    threads: Callable[[float], float] = lambda _: 20,
) -> list[Sample]:
    times = range(10, int(until_s) + 1, 10)
    return [
        Sample(time_s, rss_mib(time_s), p50_ms(time_s), 2 * p50_ms(time_s), int(files(time_s)), int(threads(time_s)))
        for time_s in times
    ]


def flat(value: float) -> Callable[[float], float]:
    return lambda time_s: value + time_s % 7 / 7  # noise


def growing(value: float, per_minute: float) -> Callable[[float], float]:
    return lambda time_s: value + per_minute * time_s / 60


def test_a_steady_run_is_right() -> None:
    # What happens in the warm-up is no drift.
    found = report(run(lambda t: 300.0 if t > 60 else 100.0, lambda t: 30.0 if t > 60 else 5.0), SECONDS, 0)
    assert found["wrong"] == []
    assert found["rss_mib"] == {"start": 300.0, "end": 300.0}
    assert found["latency_p50_ms"] == {"first_third": 30.0, "last_third": 30.0}
    minutes = found["minutes"]
    assert isinstance(minutes, list)
    assert len(minutes) == 10
    assert minutes[5] == {"rss_mib": 300.0, "pss_mib": 0.0, "p50_ms": 30.0, "p95_ms": 60.0}


@pytest.mark.parametrize(
    ("samples", "exit_code", "said"),
    [
        (run(growing(300, 3), flat(30)), 0, ["memory grew by 26"]),
        (run(flat(300), growing(30, 1)), 0, ["the median latency grew by 6"]),
        (run(flat(300), flat(30), files=growing(40, 1)), 0, ["files grew by 6"]),
        (run(flat(300), flat(30), threads=growing(20, 0.5)), 0, ["threads grew by 3"]),
        (run(flat(300), flat(30)), 1, ["exit code 1"]),
        (run(flat(300), flat(30)), None, ["exit code None"]),
        (run(flat(300), flat(30), 300), None, ["ended before its time"]),
        ([], 0, ["ended before its time"]),
    ],
    ids=["memory", "latency", "files", "threads", "exit code", "no end", "early end", "no start"],
)
def test_what_is_wrong_is_said(samples: list[Sample], exit_code: int | None, said: list[str]) -> None:
    wrong = report(samples, SECONDS, exit_code)["wrong"]
    assert isinstance(wrong, list)
    assert [word in line for word, line in zip(said, wrong, strict=True)] == [True]


@pytest.mark.slow
def test_a_camera_that_is_changed_all_the_time_keeps_no_more_than_its_caches() -> None:
    # In so short a time the places that it keeps are still being read: some 60 MiB. A picture that each of the changes
    # left behind would be hundreds.
    assert main(["--seconds", "20", "--changes", "10", "--growth", "70"]) == 0
