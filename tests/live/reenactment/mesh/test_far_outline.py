"""The far outline of a turned face: nothing of what the cheek hides shows between the cheek and what is behind it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.image_types import RgbaImage
from relit_camera.live.reenactment.mesh.far_outline import (
    STRIP_CELLS,
    SUBPIXELS,
    OutlineTask,
    Silhouette,
    plan_far_outline,
)
from relit_camera.live.reenactment.source_image import BEYOND, UPSAMPLING
from relit_camera.live.reenactment.warp import PositionGrid

WIDTH, HEIGHT = 60, 48
CHEEK, HAIR = 30.0, 80.0
"""X in the source image: up to the first there is the cheek, from the second on hair; between them the hidden ear."""
EXACT = 0.5 / SUBPIXELS + 0.01
"""How far the share of a pixel may be off."""
LEAN = 0.25
"""Columns by which the outline moves to the right in a row."""


def source(behind_alpha: int = 255) -> RgbaImage:
    """The cheek red, the ear white, the hair blue; enlarged as a person is for warping."""
    person = np.zeros((HEIGHT, 140, 4), np.uint8)
    person[:, : int(CHEEK)] = 200, 0, 0, 255
    person[:, int(CHEEK) : int(HAIR)] = 255, 255, 255, 255
    person[:, int(HAIR) :] = 0, 0, 200, behind_alpha
    return person.repeat(UPSAMPLING, axis=0).repeat(UPSAMPLING, axis=1)


def outline_at(row: ArrayLike) -> NDArray[np.float64]:
    """Column of the picture at which the face ends."""
    return 24 + LEAN * np.asarray(row)


def grid(step: int, strip: float = 0.0) -> PositionGrid:
    """The face ends at the outline; `strip` cells beyond it still look at the ear."""
    columns = (np.arange(-(-WIDTH // step) + 2) - 0.5) * step
    rows = (np.arange(-(-HEIGHT // step) + 2) - 0.5) * step
    x, y = np.meshgrid(columns, rows)
    beyond = x - outline_at(y)
    looks = np.where(beyond < 0, CHEEK - 2 + 0.2 * beyond, HAIR + 2 + beyond)
    looks = np.where((beyond >= 0) & (beyond < strip * step), (CHEEK + HAIR) / 2, looks)
    return PositionGrid(np.dstack([looks, y]).astype(np.float32), (0, 0, WIDTH, HEIGHT), step)


def silhouette(share: float = 1.0, hiding: float = 1.0) -> Silhouette:
    top, bottom = ([float(outline_at(row)), row] for row in (-20.0, HEIGHT + 20.0))
    corners = np.array([[top, bottom, [-100.0, -20.0]], [bottom, [-100.0, HEIGHT + 20.0], [-100.0, -20.0]]])
    return Silhouette(corners, np.array([[top, bottom]]), np.array([share]), np.array([hiding]))


def drawn(face: Silhouette, looks: PositionGrid, person: RgbaImage) -> tuple[RgbaImage, RgbaImage, OutlineTask]:
    """The picture before, and with the outline drawn."""
    before = looks.sample(person, UPSAMPLING, BEYOND)
    task = plan_far_outline(face, looks)
    assert task is not None
    after = before.copy()
    task.draw(after, person)
    return before, after, task


def filled() -> NDArray[np.float64]:
    """The share of each pixel (HEIGHT, WIDTH) that the face fills, from 32 × 32 points."""
    fine = (np.arange(32) + 0.5) / 32
    rows = (np.arange(HEIGHT)[:, None] + fine).ravel()
    columns = (np.arange(WIDTH)[:, None] + fine).ravel()
    inside = columns < outline_at(rows)[:, None]
    return inside.reshape(HEIGHT, 32, WIDTH, 32).mean(axis=(1, 3))


def white(picture: RgbaImage) -> int:
    """How much of the ear shows: the green of the whitest pixel, which neither cheek nor hair has."""
    return int(picture[..., 1].max())


@pytest.mark.parametrize("step", [1, 2, 3, 4, 8])
@pytest.mark.parametrize("strip", [0, STRIP_CELLS])
def test_nothing_of_the_ear_shows_and_edge_pixels_are_mixed_by_area(step: int, strip: int) -> None:
    before, after, _ = drawn(silhouette(), grid(step, strip), source())
    assert white(before) > 150 or (step == 1 and not strip)
    assert white(after) == 0
    area = np.s_[2 : HEIGHT - 2]  # at the box's rim cells are cut off
    np.testing.assert_allclose(after[area][..., 0], 200 * filled()[area], atol=200 * EXACT)
    np.testing.assert_allclose(after[area][..., 2], 200 * (1 - filled()[area]), atol=200 * EXACT)


def test_what_is_in_sight_beside_the_cheek_stays() -> None:
    looks = grid(2, STRIP_CELLS)
    _, after, _ = drawn(silhouette(hiding=0), looks, source())
    _, half, _ = drawn(silhouette(hiding=0.5), looks, source())
    assert white(after) > 250
    assert 0 < (half[..., 1] > 100).sum() < (after[..., 1] > 100).sum()


def test_before_the_background_alpha_is_the_area_and_colors_stay_pure() -> None:
    _, after, _ = drawn(silhouette(), grid(2), source(behind_alpha=0))
    area = np.s_[2 : HEIGHT - 2]
    np.testing.assert_allclose(after[area][..., 3], 255 * filled()[area], atol=255 * EXACT)
    assert (after[after[..., 3] > 8][:, 0] == 200).all()


def test_it_is_drawn_as_far_as_its_share_and_only_next_to_the_outline() -> None:
    looks, person = grid(2), source()
    before, whole, task = drawn(silhouette(), looks, person)
    _, half, _ = drawn(silhouette(share=0.5), looks, person)
    _, none, _ = drawn(silhouette(share=0.0), looks, person)
    np.testing.assert_array_equal(none, before)
    expected = (before.astype(float) + whole) / 2
    np.testing.assert_allclose(half[4:-4], expected[4:-4], atol=2)
    row, column = task.pixels + np.array(task.face.box[1::-1])[:, None]
    aside = np.abs(column - outline_at(row))
    assert aside.max() <= 2 * (STRIP_CELLS + 2)
    changed = np.nonzero((before != whole).any(axis=2))
    assert np.abs(changed[1] - outline_at(changed[0])).max() <= 2 * (STRIP_CELLS + 2)


def test_there_may_be_nothing_to_draw() -> None:
    away = silhouette()
    beside = Silhouette(away.corners + [500, 0], away.edges + [500, 0], away.shares, away.hiding)
    assert plan_far_outline(beside, grid(2)) is None
    assert plan_far_outline(None, grid(2)) is None
