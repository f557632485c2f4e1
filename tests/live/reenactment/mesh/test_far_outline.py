"""The far outline of a turned face: nothing of what the cheek hides shows between the cheek and what is behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from relit_camera.base.images.image_types import RgbaImage
from relit_camera.live.reenactment.mesh.far_outline import STRIP_CELLS, OutlineTask, Silhouette, plan_far_outline
from relit_camera.live.reenactment.source_image import BEYOND, UPSAMPLING
from relit_camera.live.reenactment.warp import PositionGrid

WIDTH, HEIGHT = 61, 47
AT = (7, 5)
"""Where the picture lies in the output."""
CHEEK, HAIR = 30, 80
"""X in the source image: up to the first there is the cheek, from the second on hair; between them the hidden ear."""
WHOLE = (-20.0, HEIGHT + 20.0)
"""Rows from which to which a face's outline goes."""
NO_TIE = 0.137
"""Columns by which the outline is moved: a cell whose middle lies on it may count for the face or not."""
BRIGHTER = 2
"""Codes by which the cheek is brighter in each row of the source image."""


@dataclass(frozen=True)
class Scene:
    """A face whose outline leans to the right by so many columns a row.

    Attributes:
        lean: those columns.
        left: whether the face lies at the left of its outline.
        strip: cells beyond the outline that still look at the ear.
    """

    lean: float = 0.25
    left: bool = True
    strip: float = 0.0

    def column(self, row: ArrayLike) -> NDArray[np.float64]:
        """Column of the picture at which the face ends."""
        return WIDTH / 2 + NO_TIE + self.lean * (np.asarray(row, np.float64) - HEIGHT / 2)

    def beyond(self, column: ArrayLike, row: ArrayLike) -> NDArray[np.float64]:
        """Columns between a point and the face; negative within it."""
        return np.asarray((1 if self.left else -1) * (np.asarray(column, np.float64) - self.column(row)))

    def grid(self, step: int) -> PositionGrid:
        """Where the picture looks."""
        x, y = np.meshgrid(*((np.arange(-(-side // step) + 2) - 0.5) * step for side in (WIDTH, HEIGHT)))
        beyond = self.beyond(x, y)
        looks = np.where(beyond < 0, CHEEK - 2 + 0.2 * beyond, HAIR + 2 + beyond)
        looks = np.where((beyond >= 0) & (beyond < self.strip * step), (CHEEK + HAIR) / 2, looks)
        box = (AT[0], AT[1], AT[0] + WIDTH, AT[1] + HEIGHT)
        return PositionGrid(np.dstack([looks, y]).astype(np.float32), box, step)

    def silhouette(self, rows: tuple[float, ...] = WHOLE, share: float = 1, hiding: float = 1) -> Silhouette:
        """Its sides go from row to row; the face fills all beside them."""
        far = -100.0 if self.left else WIDTH + 100.0
        top, bottom = ([float(self.column(row)), row] for row in WHOLE)
        corners = np.array([[top, bottom, [far, WHOLE[0]]], [bottom, [far, WHOLE[1]], [far, WHOLE[0]]]])
        ends = np.column_stack([self.column(rows), rows])
        edges = np.stack([ends[:-1], ends[1:]], axis=1)
        return Silhouette(corners, edges, np.full(len(edges), share), np.full(len(edges), hiding))

    def filled(self) -> NDArray[np.float64]:
        """The share of each pixel (HEIGHT, WIDTH) that the face fills, from 32 × 32 points."""
        fine = (np.arange(32) + 0.5) / 32
        rows, columns = ((np.arange(side)[:, None] + fine).ravel() for side in (HEIGHT, WIDTH))
        inside = self.beyond(columns, rows[:, None]) < 0
        return np.asarray(inside.reshape(HEIGHT, 32, WIDTH, 32).mean(axis=(1, 3)))


def person(behind_alpha: int = 255) -> RgbaImage:
    """The cheek red, the ear white, the hair blue; enlarged as a person is for warping."""
    source = np.zeros((HEIGHT + 40, 180, 4), np.uint8)
    source[:, :CHEEK, 0] = 100 + BRIGHTER * np.arange(len(source)).clip(max=HEIGHT)[:, None]
    source[:, :CHEEK, 3] = 255
    source[:, CHEEK:HAIR] = 255
    source[:, HAIR:] = 0, 0, 200, behind_alpha
    return source.repeat(UPSAMPLING, axis=0).repeat(UPSAMPLING, axis=1)


def drawn(
    silhouette: Silhouette, looks: PositionGrid, of: RgbaImage, half_size: bool = False
) -> tuple[RgbaImage, RgbaImage]:
    """The picture before, and with the outline drawn."""
    before = looks.sample(of, UPSAMPLING, BEYOND)
    task = plan_far_outline(silhouette, looks, half_size)
    assert task is not None
    after = before.copy()
    task.draw(after, of)
    return before, after


def white(picture: RgbaImage) -> int:
    """How much of the ear shows: the green of the whitest pixel, which neither cheek nor hair has."""
    return int(picture[..., 1].max())


@pytest.mark.parametrize("half_size", [False, True])
@pytest.mark.parametrize("step", [1, 2, 3, 4, 8])
@pytest.mark.parametrize("covered", [False, True])
def test_nothing_of_the_ear_shows_and_edge_pixels_are_mixed_by_area(step: int, covered: bool, half_size: bool) -> None:
    scene = Scene(strip=STRIP_CELLS * (covered and not half_size))
    before, after = drawn(scene.silhouette(), scene.grid(step), person(), half_size)
    assert white(before) > 150 or (step == 1 and scene.strip == 0)
    assert white(after) == 0
    filled, cheek = scene.filled(), 100 + BRIGHTER * np.arange(HEIGHT)[:, None]
    np.testing.assert_allclose(after[..., 2], 200 * (1 - filled), atol=200 * 0.14)
    np.testing.assert_allclose(after[..., 0], cheek * filled, atol=200 * 0.14)
    within = np.where(filled == 1, after[..., 0], cheek)
    np.testing.assert_allclose(within, np.broadcast_to(cheek, within.shape), atol=0.6 * step * BRIGHTER)


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("lean", [-1.0, -0.4, 0.0, 0.4, 1.0])
def test_the_face_is_hardly_wider_than_it_is(lean: float, left: bool) -> None:
    """By a quarter of a pixel at most: see `SUBPIXELS`."""
    scene = Scene(lean, left)
    _, after = drawn(scene.silhouette(), scene.grid(2), person())
    too_much = (1 - scene.filled()) - after[..., 2] / 200
    assert np.abs(too_much).max() < 0.36
    assert 0 <= too_much.sum(axis=1)[4:-4].mean() < 0.28


def test_the_face_and_what_is_behind_it_look_where_the_warp_has_them() -> None:
    """What goes on beyond the outline is a mean of cells; the cells themselves stay."""
    scene = Scene(lean=0.0)
    looks = scene.grid(1)
    task = plan_far_outline(scene.silhouette(), looks)
    assert task is not None
    rows, columns = task.pixels
    expected = looks.nodes()[rows, columns]
    beyond = scene.beyond(columns + 0.5, rows + 0.5)
    for shown, there in ((task.face, beyond < 0), (task.behind, beyond > STRIP_CELLS)):
        assert there.any()
        np.testing.assert_allclose(shown[there], expected[there], atol=1e-3)


def test_codes_are_rounded_to_the_next() -> None:
    """Before what is clear in color, 0.499 of a pixel with 200 is 99.8."""
    one, full = np.zeros((1, 1, 4), np.uint8), np.ones(1, np.float32)
    of = np.full((8, 8, 4), 200, np.uint8)
    looks = np.full((1, 2), 1.0, np.float32)
    one[..., 3] = 200
    OutlineTask(np.zeros((2, 1), np.intp), looks, looks, full, np.array([0.499], np.float32)).draw(one, of)
    assert one[0, 0].tolist() == [100, 100, 100, 200]


def test_what_is_in_sight_beside_the_cheek_stays() -> None:
    scene = Scene(strip=STRIP_CELLS)
    _, after = drawn(scene.silhouette(hiding=0), scene.grid(2), person())
    _, half = drawn(scene.silhouette(hiding=0.5), scene.grid(2), person())
    assert white(after) > 250
    assert 0 < (half[..., 1] > 100).sum() < (after[..., 1] > 100).sum()


def test_before_the_background_alpha_is_the_area_and_colors_stay_pure() -> None:
    scene = Scene()
    _, after = drawn(scene.silhouette(), scene.grid(2), person(behind_alpha=0))
    np.testing.assert_allclose(after[..., 3], 255 * scene.filled(), atol=255 * 0.14)
    assert (after[after[..., 3] > 8][:, 1:3] == 0).all()


def test_it_is_drawn_as_far_as_its_share_and_only_next_to_the_outline() -> None:
    scene, of = Scene(), person()
    looks = scene.grid(2)
    before, whole = drawn(scene.silhouette(), looks, of)
    _, half = drawn(scene.silhouette(share=0.5), looks, of)
    assert plan_far_outline(scene.silhouette(share=0.0), looks) is None
    np.testing.assert_allclose(half, (before.astype(float) + whole) / 2, atol=2)
    rows, columns = np.nonzero((before != whole).any(axis=2))
    assert np.abs(scene.beyond(columns + 0.5, rows + 0.5)).max() <= 2 * (STRIP_CELLS + 1)


def test_only_the_sides_that_are_to_be_drawn_are() -> None:
    """Three sides below each other: one drawn, one half, one not. At their ends the larger share counts."""
    scene, of = Scene(strip=STRIP_CELLS), person()
    looks = scene.grid(1)
    before, whole = drawn(scene.silhouette(), looks, of)
    parts = scene.silhouette((WHOLE[0], 8.0, 30.0, WHOLE[1]))
    _, after = drawn(Silhouette(parts.corners, parts.edges, np.array([1, 0.5, 0]), parts.hiding), looks, of)
    np.testing.assert_array_equal(after[:8], whole[:8])
    np.testing.assert_allclose(after[18:30], (before[18:30].astype(float) + whole[18:30]) / 2, atol=2)
    np.testing.assert_array_equal(after[40:], before[40:])
    _, middle = drawn(scene.silhouette((18.0, 28.0)), looks, of)
    np.testing.assert_array_equal(middle[18:28], whole[18:28])
    np.testing.assert_array_equal(middle[:6], before[:6])


def test_where_nothing_else_is_near_what_is_beside_the_face_shows() -> None:
    """At the picture's border there are not enough cells beyond the strip."""
    scene, of = Scene(lean=0.0), person()
    looks = scene.grid(2)
    columns = int(scene.column(0) / 2) + 1
    narrow = PositionGrid(looks.positions[:, : columns + 2], (0, 0, 2 * columns, HEIGHT), 2)
    before, after = drawn(scene.silhouette(), narrow, of)
    assert white(before) > 150
    assert white(after) == 0


def test_there_may_be_nothing_to_draw() -> None:
    scene = Scene()
    there = scene.silhouette()
    beside = Silhouette(there.corners + [500, 0], there.edges + [500, 0], there.shares, there.hiding)
    assert plan_far_outline(beside, scene.grid(2)) is None
    assert plan_far_outline(None, scene.grid(2)) is None
