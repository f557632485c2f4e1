"""Where the live picture looks in the source image, corrected by the flow between both."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from relit_camera.live.modes.live_alignment import TUNABLES, ComparedCells, LiveAlignment
from relit_camera.live.reenactment.warp import PositionGrid
from tests.live.people import close_up, face_of

COLUMNS, ROWS = 96, 128
UNIT = 39.5
"""About what is between the face's eyes, in pixels."""
SHIFT_PX = 0.1 * UNIT
BODY = np.s_[ROWS // 2 + 10 : ROWS - 10, 10 : COLUMNS - 10]


@pytest.fixture
def alignment() -> LiveAlignment:
    face = face_of(close_up())
    assert face.size == (COLUMNS, ROWS)
    return LiveAlignment(face)


def looks() -> np.ndarray:
    """Where the cells of a live picture of the source image's size look: at what is there, as OpenCV counts."""
    return np.stack(np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)), axis=-1).astype(np.float32)


def pattern() -> np.ndarray:
    """Roots of light with detail everywhere."""
    random = np.random.default_rng(3).normal(0.5, 0.2, (ROWS // 4, COLUMNS // 4, 3)).astype(np.float32)
    return np.clip(cv2.resize(random, (COLUMNS, ROWS), interpolation=cv2.INTER_CUBIC), 0.05, 1)


def with_body_moved(picture: np.ndarray) -> np.ndarray:
    """The same with its lower half further to the right."""
    moved = cv2.warpAffine(picture, np.array([[1.0, 0, SHIFT_PX], [0, 1, 0]]), (COLUMNS, ROWS), borderMode=1)
    return np.concatenate([picture[: ROWS // 2], moved[ROWS // 2 :]])


def cells(live: np.ndarray, confidence: np.ndarray | None = None) -> ComparedCells:
    sure = np.ones((ROWS, COLUMNS), np.float32) if confidence is None else confidence
    return ComparedCells(live, pattern(), sure, looks(), UNIT)


def correction(alignment: LiveAlignment) -> np.ndarray:
    """By how many source pixels each cell looks elsewhere, (rows, columns, 2)."""
    grid = PositionGrid(cv2.copyMakeBorder(looks() + np.float32(0.5), 1, 1, 1, 1, 1), (0, 0, COLUMNS, ROWS), 1)
    return alignment.corrected(grid).nodes() - grid.nodes()


def test_before_the_first_frame_nothing_is_corrected(alignment: LiveAlignment) -> None:
    assert alignment.is_due(0)
    assert np.all(correction(alignment) == 0)


@pytest.mark.parametrize("exposure", [1.0, 0.8])
def test_what_lies_where_it_is_expected_stays(alignment: LiveAlignment, exposure: float) -> None:
    alignment.update(cells(pattern() * np.float32(exposure)), 0)
    assert np.abs(correction(alignment)).mean() < 0.03 * UNIT


def test_a_body_beside_where_it_is_expected_is_found_there(alignment: LiveAlignment) -> None:
    alignment.update(cells(with_body_moved(pattern())), 0)
    found = correction(alignment)
    np.testing.assert_allclose(np.median(found[BODY], axis=(0, 1)), [-SHIFT_PX, 0], atol=0.2 * SHIFT_PX)
    assert np.abs(found[: ROWS // 2 - 15]).mean() < 0.2 * SHIFT_PX


def test_a_wall_that_moves_beside_the_person_does_not_count(alignment: LiveAlignment) -> None:
    person = np.zeros((ROWS, COLUMNS), np.float32)
    person[: ROWS // 2] = 1
    alignment.update(cells(with_body_moved(pattern()), person), 0)
    assert np.abs(correction(alignment)).max() < 0.1 * SHIFT_PX


def test_one_frame_counts_as_long_as_it_lasts(alignment: LiveAlignment) -> None:
    for step in range(10):
        alignment.update(cells(pattern()), step * 0.1)
    before = correction(alignment)[BODY]
    alignment.update(cells(with_body_moved(pattern())), 1.0)
    found = np.median((correction(alignment)[BODY] - before)[..., 0])
    assert found == pytest.approx(-SHIFT_PX * (1 - np.exp(-0.1 / TUNABLES.time_constant_s)), rel=0.25)


def test_after_a_pause_only_what_is_seen_counts(alignment: LiveAlignment) -> None:
    alignment.update(cells(with_body_moved(pattern())), 0)
    alignment.update(cells(pattern()), 60)
    assert np.abs(correction(alignment)).mean() < 0.03 * UNIT


def test_flows_keep_their_interval_and_a_clip_that_starts_anew_has_one_at_once(alignment: LiveAlignment) -> None:
    alignment.update(cells(pattern()), 5.0)
    assert not alignment.is_due(5.0 + 0.5 * TUNABLES.interval_s)
    assert alignment.is_due(5.0 + 1.01 * TUNABLES.interval_s)
    assert alignment.is_due(0.0)
    alignment.update(cells(with_body_moved(pattern())), 0.0)
    assert np.median(correction(alignment)[BODY][..., 0]) == pytest.approx(-SHIFT_PX, rel=0.2)


def test_the_noise_of_a_dark_picture_moves_next_to_nothing(alignment: LiveAlignment) -> None:
    sure = np.ones((ROWS, COLUMNS), np.float32)
    random, even = np.random.default_rng(2), np.full((ROWS, COLUMNS, 3), 0.01, np.float32)
    for step in range(10):
        dark = np.abs(random.normal(0, 0.01, even.shape)).astype(np.float32)
        alignment.update(ComparedCells(dark, even, sure, looks(), UNIT), step / 10)
    assert np.abs(correction(alignment)).mean() < 0.02 * UNIT


@pytest.mark.parametrize(
    ("rows", "columns", "unit"), [(1, 1, 10), (120, 3, 10), (120, 16, 60), (4, 5, 30), (60, 8, 30)]
)
def test_where_hardly_anything_is_seen_nothing_is_corrected(
    alignment: LiveAlignment, rows: int, columns: int, unit: float
) -> None:
    few = np.s_[:rows, :columns]
    large = np.ones((rows, columns, 3), np.float32)
    places = np.zeros((rows, columns, 2), np.float32)
    alignment.update(ComparedCells(large, large, large[..., 0], places, unit), 0)
    assert correction(alignment)[few].max() == 0


def test_a_profile_whose_eyes_seem_to_meet_is_compared_in_no_more_pixels(alignment: LiveAlignment) -> None:
    narrow = ComparedCells(with_body_moved(pattern()), pattern(), np.ones((ROWS, COLUMNS), np.float32), looks(), 1e-3)
    alignment.update(narrow, 0)
    assert np.isfinite(correction(alignment)).all()
