"""What people are told of how a subject was captured."""

from __future__ import annotations

import pytest

from relit_camera.subject.rungs import EXPECTED_DB, Rung, describe_places, describe_rung


@pytest.mark.parametrize("rung", ["instant", "desk", "film", "pictures"])
def test_every_rung_has_its_words(rung: Rung) -> None:
    told = describe_rung(rung, EXPECTED_DB.get(rung), 0.25)
    assert told.startswith(f"{rung}: ")
    assert "25 % of all directions" in told
    assert ("dB" in told) == (rung in EXPECTED_DB)


def test_what_was_not_measured_is_said() -> None:
    assert "all are modelled" in describe_rung("instant", 26.0, 0.0)
    assert "older version" in describe_rung(None, None, None)


def test_places_are_told_by_name() -> None:
    told = describe_places({"studio": 0.624, "window": 1.0})
    assert told == "measured of the light of studio 62 %, window 100 %; the rest is modelled"
