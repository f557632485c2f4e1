"""Drawing expression stills into the moved picture: mouth, eyes and turned cheeks as they really look, relit.

Each part of the face is a mesh of landmarks, which is moved from the stills to where the driver's face has it. It fades
out at its rim.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.images.image_types import Box, LinearImage, RgbaImage
from relit_camera.base.images.light_multiplication import multiply_light
from relit_camera.base.rotations import Rotation, angles_from_rotation
from relit_camera.face.head_pose import HeadPose
from relit_camera.live.reenactment.mesh.triangle_drawing import draw_triangles
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.reenactment.stills.still_light import StillLight
from relit_camera.live.reenactment.stills.still_regions import (
    BEHIND_CM,
    StillRegion,
    facing,
    still_regions,
)
from relit_camera.live.reenactment.stills.still_weights import Doing, StillWeights
from relit_camera.live.reenactment.warp import PositionGrid
from relit_camera.subject.expression_stills import ExpressionStill
from relit_camera.subject.subject import Subject

TURN_STEPS = 2
"""The cheeks of a turned face are large and smooth: their positions are computed so many times as far apart."""
NEAR_CHEEK_DEG = (12.0, 24.0)
"""Yaw from which on a still shows the near cheek too, and from where on fully: up to it the source image's is sharper,
later it is a few columns of pixels, drawn wide."""
HALVED_FROM = 1.5
"""By how much a face in the picture must be larger than in the stills for them to be drawn at half its resolution."""
WHOLE_MOUTH = 0.98
"""Weight of the stills of a mouth from which nothing else shows there."""
LEAST_SIDE_PX = 4
"""Smaller parts of the picture are not drawn."""


@dataclass(frozen=True)
class _Layer:
    """One still in one region of the output.

    Attributes:
        still: its index.
        grid: where the region's pixels look in the still.
        cover: (height, width) float32 how far it shows.
    """

    still: int
    grid: PositionGrid
    cover: NDArray[np.float32]


@dataclass(frozen=True)
class _PlannedRegion:
    """What shows in one region of the output.

    Attributes:
        box: left, top, right, bottom in output pixels.
        layers: stills, of one size: the box's, or half of it.
        source: (rows, columns, 2) float32 where the middles of the cells of their grids lie in the source image.
    """

    box: Box
    layers: tuple[_Layer, ...]
    source: NDArray[np.float32]


@dataclass(frozen=True)
class StillTask:
    """What is drawn into one moved picture.

    Attributes:
        light: of the subject's stills.
        regions: what shows where.
        has_mouth: whether stills show all of the mouth.
    """

    light: StillLight
    regions: tuple[_PlannedRegion, ...]
    has_mouth: bool

    def draw(self, image: RgbaImage, relit: LinearImage) -> None:
        """Draw into the moved picture, in place, from the relit source image; its alpha stays."""
        if self.regions:
            roots = self.light.relit_roots(relit)
            for region in self.regions:
                self._draw(image, region, roots)

    def _draw(self, image: RgbaImage, region: _PlannedRegion, relit: NDArray[np.float32]) -> None:
        shown, cover = None, None
        for layer in region.layers:
            picture = layer.grid.sample(self.light.unlit[layer.still])
            if shown is None or cover is None:
                shown, cover = picture, layer.cover
            else:
                shown = cv2.blendLinear(shown, picture, cover, layer.cover)
                cover = cv2.add(cover, layer.cover)
        assert shown is not None
        assert cover is not None
        shown = multiply_light(shown, self.light.at(relit, region.source), region.layers[0].grid.step)
        left, top, right, bottom = region.box
        area = image[top:bottom, left:right]
        if shown.shape[:2] != area.shape[:2]:
            shown, cover = (_doubled(each, area.shape) for each in (shown, cover))
        below = cv2.cvtColor(area, cv2.COLOR_RGBA2RGB)
        area[..., :3] = cv2.blendLinear(shown, below, cover, cv2.subtract(1.0, cover))


class StillDrawing:
    """Draws the stills of one subject."""

    def __init__(self, subject: Subject, face: SourceFace) -> None:
        """`face` is the source image's, in the scheme of the stills."""
        self._face = face
        self._light = StillLight(subject, face)
        self._meshes = [
            _RegionMesh(region, face, subject.stills, self._light.shown) for region in still_regions(face.scheme)
        ]
        self._weights = StillWeights(subject.stills, face)

    def plan(
        self,
        landmarks: NDArray[np.float64],
        pose: HeadPose,
        expression: NDArray[np.float64],
        time_s: float,
        to_picture: NDArray[np.float64],
        size: tuple[int, int],
        step: int,
        half_size: bool = False,
    ) -> StillTask:
        """Find out what shows where; the task draws it.

        Args:
            landmarks: (count, 2) where all landmarks of the moved face are, source pixels.
            pose: of the moved head.
            expression: (count, 3) centimetres since neutral.
            time_s: of the frame.
            to_picture: (2, 3) source pixels → pixels of the moved picture.
            size: (width, height) of that.
            step: pixels between computed positions.
            half_size: draw at half the picture's resolution at most, positions twice as far apart.
        """
        rotation = pose.rotation * self._face.pose.rotation.inv()
        doing = self._weights.doing(expression, rotation)
        chosen = self._weights.update(doing, time_s)
        seen = landmarks @ to_picture[:, :2].T + to_picture[:, 2]
        depth = pose.rotation.as_matrix()[2]
        step = 2 * step if half_size else step
        drawn = [
            mesh.plan(
                chosen[mesh.region.name],
                seen,
                depth,
                size,
                step * TURN_STEPS if mesh.region.is_turn else step,
                half_size,
                self._kept(mesh.region, doing, rotation),
            )
            for mesh in self._meshes
            if chosen[mesh.region.name]
        ]
        mouth = sum(weight for _, weight in chosen["mouth"])
        return StillTask(self._light, tuple(region for region in drawn if region is not None), mouth >= WHOLE_MOUTH)

    def _kept(self, region: StillRegion, doing: Doing, rotation: Rotation) -> NDArray[np.float64]:
        """How far each landmark (landmarks,) of a region is kept, 0..1.

        Of a turned face a shut eye is not, which its stills show open, nor the near cheek while it is hardly turned.
        """
        # By the turn to that side: while a head swings over, the still of the side that it comes from fades out.
        yaw = angles_from_rotation(rotation).yaw * (-1 if region.name == "right_turn" else 1)
        near = smoothstep(yaw, *NEAR_CHEEK_DEG)
        return np.asarray(1 - doing.needed[region.eye_name] * region.eye - (1 - near) * region.near)


def _doubled(picture: NDArray, shape: tuple[int, ...]) -> NDArray:
    """A picture of twice the size, its last row and column left out where `shape` (height, width, …) is odd."""
    large = cv2.resize(picture, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
    return np.ascontiguousarray(large[: shape[0], : shape[1]])


class _RegionMesh:
    """A region's mesh with its places in the stills."""

    def __init__(
        self, region: StillRegion, face: SourceFace, stills: Sequence[ExpressionStill], shown: NDArray[np.float64]
    ) -> None:
        """`shown` (stills, landmarks) is how far each still shows each landmark."""
        self.region = region
        triangles = region.triangles
        self._source = face.landmarks[triangles].astype(np.float64)
        self._scheme = face.scheme
        self._spans = [face.scheme.eye_span(still.landmarks) for still in stills]
        self._places = []
        for still, seen in zip(stills, shown, strict=True):
            corners = still.landmarks[triangles].astype(np.float64)
            front = facing(corners) | region.between  # the others are turned away in the still
            trust = (region.trust * seen)[triangles] * front[:, None]
            self._places.append(np.concatenate([corners, trust[..., None]], axis=2))

    def plan(
        self,
        chosen: Sequence[tuple[int, float]],
        seen: NDArray[np.float64],
        depth: NDArray[np.float64],
        size: tuple[int, int],
        step: int,
        half_size: bool,
        kept: NDArray[np.float64],
    ) -> _PlannedRegion | None:
        """What shows in the picture; None where nothing does.

        Args:
            chosen: stills and their weights, one at least.
            seen: (count, 2) landmarks in the picture.
            depth: (3,) direction in the head toward the camera.
            size: (width, height) of the picture.
            step: pixels between computed positions.
            half_size: draw at half the picture's resolution, however fine the stills are.
            kept: (landmarks,) how far the stills count at each, 0..1.
        """
        # A still shows up to the far corners of the outermost triangles.
        showing = (self.region.trust * kept > 0)[self.region.triangles].any(axis=1)
        inside = seen[self.region.triangles[showing].ravel()]
        if not len(inside):
            return None
        low = np.maximum(np.floor(inside.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(inside.max(axis=0)).astype(int), size)
        if (high - low < LEAST_SIDE_PX).any():
            return None
        width, height = (int(side) for side in high - low)
        finest = max(self._spans[still] for still, _ in chosen)
        halved = half_size or self._scheme.eye_span(seen.astype(np.float32)) > HALVED_FROM * finest
        step += step % 2  # so that it can be halved
        # Positions are those of the middles of cells, one more round the box: see `PositionGrid`.
        corners = ((seen - low) / step + 0.5).take(self.region.triangles, axis=0)
        front = np.flatnonzero(facing(corners) | self.region.between)
        nearness = self.region.middles @ depth - BEHIND_CM * self.region.between
        order = front[np.argsort(nearness[front])]
        places = (self._source, *(self._places[still] for still, _ in chosen))
        values = np.concatenate([each.take(order, axis=0) for each in places], axis=2)
        values[..., 4::3] *= kept[self.region.triangles.take(order, axis=0)][..., None]  # the trust of each still
        shape = (-(-height // step) + 2, -(-width // step) + 2)
        drawn = draw_triangles(corners.take(order, axis=0), values, shape)
        box = (int(low[0]), int(low[1]), int(high[0]), int(high[1]))
        # Between a cell of the mesh and one beside it positions mean nothing.
        within = cv2.erode((drawn[0] > 0).astype(np.float32), np.ones((3, 3), np.uint8))
        layers = []
        for index, (still, weight) in enumerate(chosen):
            x, y, trust = drawn[2 + 3 * index : 5 + 3 * index]
            grid = PositionGrid(cv2.merge([x, y]), box, step)
            grid = grid.halved() if halved else grid
            fine = cv2.resize(trust * within * np.float32(weight), None, fx=grid.step, fy=grid.step)
            left, top, right, bottom = grid.box
            part = fine[grid.step : grid.step + bottom - top, grid.step : grid.step + right - left]
            layers.append(_Layer(still, grid, np.ascontiguousarray(part)))
        source = np.ascontiguousarray(cv2.merge([drawn[0], drawn[1]])[1:-1, 1:-1])
        return _PlannedRegion(box, tuple(layers), source)
