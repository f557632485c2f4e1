"""Light on expression stills: the stills with their own light divided out, and the light that they are shown in.

A still is shown times (relit source image) / (source image under the still's own light), looked up where the landmarks
lead in the source image's face. The divisor does not change: the stills are kept divided. A smooth factor corrects them
so that, blurred and relit, they have the colors of the relit source image: then no seam shows, whatever the light,
exposure and white balance of the film were taken for. Eyes and mouth get the light of the skin round them, and so
does hair that hangs over the face's outline.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.color import linear_from_uint8, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_camera.base.images.light_multiplication import root_of_light
from relit_camera.face.landmarks.canonical_face import canonical_face
from relit_camera.light.directions import MAP_HEIGHT, MAP_WIDTH, texel_solid_angles
from relit_camera.live.reenactment.control_points import feature_landmarks
from relit_camera.live.reenactment.mesh.triangle_drawing import draw_triangles
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.stills.still_regions import face_in_still, facing, shown_landmarks
from relit_camera.subject.expression_stills import ExpressionStill
from relit_camera.subject.subject import Subject

HAIR_SPANS = 0.15
"""Within the face's outline, where hair may hang over it, or a beard grow."""
HAIR_BRIGHTNESS = (0.6, 0.9)
"""Brightness there, in parts of that of the skin round it: up to which it is hair, and from where on skin."""
AROUND_SPANS = 0.2
"""Sigma of the blur that gives that of the skin round it."""
CELLS_PER_SPAN = 32
"""Cells of the grid in the distance of the outer eye corners."""
MARGIN_SPANS = 0.15
"""Round the face, that the grid takes in."""
MATCHED_SPANS = 0.16
"""Sigma of the blur in which still and source image agree."""
FILL_SHARES = {1.5: 1.0, 5.0: 0.02}
"""The Gaussians that lead the light of the skin into eyes and mouth: sigma in cells, and share."""
MAX_ROOT = 3.9
"""Limit of a factor's root: the tables of `multiply_light` end there."""
MAX_PIXELS_PER_CELL = 32.0
"""Of a still in a cell of the grid, side by side: more are not averaged, it would take seconds."""
FLOOR = 0.02
"""Share of the mean that is added to both sides of a quotient: shadows stay bounded."""
UNLIT_SKIN = 0.25
"""Largest channel of the mean skin in unlit stills: teeth, which are some times as bright, are not white yet."""


class StillLight:
    """The grid over the source image's face, and the unlit stills of one subject.

    Attributes:
        unlit: each still divided by the source image under the still's own light, uint8 sRGB, times the color of skin.
        shown: (stills, landmarks) float64, see `shown_landmarks`.
    """

    def __init__(self, subject: Subject, face: SourceFace) -> None:
        self._grid = _Grid.over(subject, face)
        everywhere = np.ones((MAP_HEIGHT, MAP_WIDTH, 3), np.float32)
        evenly, *under_own = _relit_on_grid(
            subject, self._grid, [everywhere, *(still.light for still in subject.stills)]
        )
        self._grid = self._grid.without_hair(evenly)
        skin = np.array(cv2.mean(np.mean(under_own, axis=0), (self._grid.skin > 0.5).astype(np.uint8))[:3])
        self._skin = np.maximum(skin / max(float(skin.max()), 1e-6), 0.1).astype(np.float32) * np.float32(UNLIT_SKIN)
        self.unlit: list[DisplayImage] = []
        shown = []
        for still, own in zip(subject.stills, under_own, strict=True):
            placed = face_in_still(still, face)
            shown.append(shown_landmarks(still, face, placed))
            seen = _on_source(still, face, self._grid, shown[-1])
            self.unlit.append(_unlit(still, placed, self._grid, seen, _filled(own, self._grid.skin), self._skin))
        self.shown = np.stack(shown)
        self._last: tuple[LinearImage, NDArray[np.float32]] | None = None

    def relit_roots(self, relit: LinearImage) -> NDArray[np.float32]:
        """Roots (rows, columns, 3) of what unlit stills are multiplied with, on the grid.

        Args:
            relit: (height, width, 3) the relit source image, which is not written to; for the same one again what was
                computed is kept.
        """
        last = self._last  # replaced as a whole: tasks run in other threads
        if last is not None and last[0] is relit:
            return last[1]
        left, top, right, bottom = self._grid.box
        part = cv2.resize(relit[top:bottom, left:right], self._grid.size, interpolation=cv2.INTER_AREA)
        light = _filled(np.maximum(part, 0), self._grid.skin)
        roots = root_of_light(np.asarray(light / self._skin, np.float32))
        np.minimum(roots, MAX_ROOT, out=roots)
        self._last = (relit, roots)
        return roots

    def at(self, picture: NDArray[np.float32], positions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Values of a picture of the grid at source pixels (rows, columns, 2)."""
        return np.asarray(
            cv2.remap(picture, self._grid.cells(positions), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        )


@dataclass(frozen=True)
class _Grid:
    """Square cells over the source image's face.

    Attributes:
        box: left, top, right, bottom in source pixels.
        cell: side of a cell in source pixels.
        skin: (rows, columns) float32, the share of a cell that is skin of the face, no eye and no lip.
        depth: (rows, columns) float32, distance from the face's outline in `span`; 0 outside.
        span: distance of the outer eye corners, in cells.
    """

    box: tuple[int, int, int, int]
    cell: int
    skin: Mask
    depth: NDArray[np.float32]
    span: float

    @property
    def size(self) -> tuple[int, int]:
        """(columns, rows)."""
        return self.skin.shape[1], self.skin.shape[0]

    def cells(self, positions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Where source pixels (..., 2) lie in pictures of the grid, as OpenCV counts."""
        return (positions - np.array(self.box[:2], np.float32)) / np.float32(self.cell) - np.float32(0.5)

    def without_hair(self, evenly: LinearImage) -> _Grid:
        """The grid whose skin leaves out what near the outline is darker than the skin round it: hair, or a beard.

        Where hair lies over the cheek in the source image a still may show skin, which divided by that would be far too
        bright. Hair that is lighter than the skin is not told from it, nor is the middle of a broad strand.

        Args:
            evenly: (rows, columns, 3) the source image in light from everywhere: with no side in shade.
        """
        light = np.repeat(evenly.mean(axis=2, keepdims=True), 3, axis=2)
        skin = self.skin
        for _ in range(2):  # at first the hair itself counts as skin
            around = _blurred(light, skin, {AROUND_SPANS * self.span: 1.0, 4 * AROUND_SPANS * self.span: 1e-3})
            bright = smoothstep((light / np.maximum(around, 1e-9))[..., 0].astype(np.float64), *HAIR_BRIGHTNESS)
            certain = smoothstep(self.depth.astype(np.float64), HAIR_SPANS, 1.5 * HAIR_SPANS)
            share = np.maximum(certain, cv2.erode(bright, np.ones((3, 3))))
            skin = np.asarray(self.skin * share, np.float32)
        return replace(self, skin=skin)

    @classmethod
    def over(cls, subject: Subject, face: SourceFace) -> _Grid:
        """The grid over a source image's face."""
        span = face.scheme.eye_span(face.landmarks)
        cell = max(round(span / CELLS_PER_SPAN), 1)
        low = np.floor(face.landmarks.min(axis=0) - MARGIN_SPANS * span).astype(int)
        high = np.ceil(face.landmarks.max(axis=0) + MARGIN_SPANS * span).astype(int)
        low, high = np.maximum(low, 0), np.minimum(high, subject.size)
        columns, rows = np.maximum((high - low) // cell, 2)
        box = (int(low[0]), int(low[1]), int(low[0] + columns * cell), int(low[1] + rows * cell))
        skin = np.zeros((box[3] - box[1], box[2] - box[0]), np.uint8)
        shifted = np.round(face.landmarks - low).astype(np.int32)
        cv2.fillPoly(skin, [shifted[list(face.scheme.oval)]], 255)
        depth = cv2.distanceTransform(skin, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) / np.float32(span)
        for feature in feature_landmarks(face.scheme):
            cv2.fillConvexPoly(skin, cv2.convexHull(shifted[list(feature)]), 0)
        share, depth = (
            cv2.resize(each, (int(columns), int(rows)), interpolation=cv2.INTER_AREA) for each in (skin, depth)
        )
        share = np.asarray(cv2.erode(share, np.ones((2, 2))) / np.float32(255), np.float32)
        return cls(box, cell, share, np.asarray(depth, np.float32), span / cell)


def _relit_on_grid(subject: Subject, grid: _Grid, lights: list[NDArray[np.float32]]) -> list[LinearImage]:
    """The source image under each light (32, 64, 3), on the grid: (rows, columns, 3) float32."""
    left, top, _, _ = grid.box
    columns, rows = grid.size
    width = subject.size[0]
    offsets = np.arange(grid.cell)
    y = top + (np.arange(rows)[:, None] * grid.cell + offsets).reshape(rows, 1, grid.cell, 1)
    x = left + (np.arange(columns)[:, None] * grid.cell + offsets).reshape(1, columns, 1, grid.cell)
    pixels = (y * width + x).reshape(rows * columns, -1)
    sampled = subject.basis.rows(pixels, np.full(pixels.shape, 1 / grid.cell**2, np.float32))
    omega = texel_solid_angles().astype(np.float32).reshape(-1, 1)
    amounts = [subject.coefficients @ (light.reshape(-1, 3) * omega) for light in lights]
    return [
        np.maximum(np.stack([sampled[c] @ amount[:, c] for c in range(3)], axis=1), 0)
        .reshape(rows, columns, 3)
        .astype(np.float32)
        for amount in amounts
    ]


def _unlit(
    still: ExpressionStill,
    placed: NDArray[np.float32],
    grid: _Grid,
    on_source: tuple[NDArray[np.float32], Mask],
    under_own: NDArray[np.float32],
    skin: NDArray[np.float32],
) -> DisplayImage:
    """A still, corrected, by the source image under its own light, times a color (3,): see `StillLight.unlit`.

    `placed` and `on_source` are what `face_in_still` and `_on_source` give for it.
    """
    seen, valid = on_source
    weight = valid * grid.skin
    sigma = MATCHED_SPANS * grid.span
    shares = {sigma: 1.0, 4 * sigma: 1e-3}
    theirs, ours = _blurred(seen, weight, shares), _blurred(under_own, weight, shares)
    sure = (weight > 0.5).astype(np.uint8)
    mean, still_mean = (max(float(cv2.mean(each, sure)[1]), 1e-4) for each in (under_own, seen))
    correction = (ours + FLOOR * mean) / (theirs + FLOOR * still_mean)
    factor = np.asarray(correction / (under_own + np.float32(FLOOR * mean)), np.float32)
    cells = grid.cells(_source_of_still(placed))
    onto = cv2.remap(factor, cells, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return uint8_from_linear(np.asarray(linear_from_uint8(still.image) * onto * skin, np.float32))


def _source_of_still(placed: NDArray[np.float32]) -> NDArray[np.float32]:
    """Where each pixel of a still lies in the source image: (height, width, 2); beyond the face, the nearest place.

    `placed` is what `face_in_still` gives.
    """
    x, y, drawn = placed
    _, labels = cv2.distanceTransformWithLabels(
        (drawn < 0.5).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    known = drawn >= 0.5
    place = np.zeros(int(labels.max()) + 1, np.intp)
    place[labels[known]] = np.flatnonzero(known)
    return np.asarray(np.dstack([x.ravel()[place[labels]], y.ravel()[place[labels]]]), np.float32)


def _on_source(
    still: ExpressionStill, face: SourceFace, grid: _Grid, shown: NDArray[np.float64]
) -> tuple[NDArray[np.float32], Mask]:
    """A still as it lies on the source image's face, linear (rows, columns, 3), and how far it shows the face.

    `shown` is what `shown_landmarks` gives.
    """
    triangles = canonical_face().triangles
    triangles = triangles[facing(still.landmarks[triangles].astype(np.float64))]
    corners = (face.landmarks - grid.box[:2]) / grid.cell - 0.5
    values = np.column_stack([still.landmarks, shown])
    columns, rows = grid.size
    x, y, valid = draw_triangles(
        corners[triangles].astype(np.float64), values[triangles].astype(np.float64), (rows, columns)
    )
    # A cell is as many pixels of the still as the eyes are wider there.
    reach = np.clip(face.scheme.eye_span(still.landmarks) / grid.span, 1.0, MAX_PIXELS_PER_CELL)
    light = cv2.GaussianBlur(linear_from_uint8(still.image), (0, 0), reach / 2)
    seen = cv2.remap(light, x - np.float32(0.5), y - np.float32(0.5), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen, np.float32), valid


def _blurred(picture: NDArray[np.float32], weight: Mask, shares: Mapping[float, float]) -> NDArray[np.float32]:
    """A picture blurred where it has weight (normalized convolution) with a sum of Gaussians, share by sigma.

    A wide one of small share leads it on smoothly where there is no weight.
    """
    weighted = picture * weight[..., None]
    total, weights = np.zeros_like(picture), np.full_like(weight, 1e-9)
    for sigma, share in shares.items():
        total += np.float32(share) * cv2.GaussianBlur(weighted, (0, 0), sigma)
        weights += np.float32(share) * cv2.GaussianBlur(weight, (0, 0), sigma)
    return np.asarray(total / weights[..., None], np.float32)


def _filled(picture: NDArray[np.float32], skin: Mask) -> NDArray[np.float32]:
    """A picture of the grid, eyes and mouth filled with the skin round them."""
    around = _blurred(picture, skin, FILL_SHARES)
    return np.asarray(around + skin[..., None] * (picture - around), np.float32)
