"""Ratio relighting: the live frame times relit(scene) / relit(room) of the subject, warped onto the live face.

The person's own mouth, eyes and texture stay in the picture; only the light is exchanged. Here is what one face tells;
`frame_relighting` relights whole frames by it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import LUMINANCE
from relit_camera.base.images.image_types import Box, DisplayImage, Frame, LinearImage
from relit_camera.base.images.light_multiplication import root_of_light
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.live_alignment import ComparedCells, LiveAlignment
from relit_camera.live.modes.live_detail import (
    Cells,
    SourceCells,
    blend_cells,
    live_cells,
    overexposed,
    shape_cells,
    smoothed,
)
from relit_camera.live.modes.source_masks import inside_face, limits, near_person, ratio_confidence, still_skin
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow
from relit_camera.live.reenactment.mesh.face_mesh import triangulate_face
from relit_camera.live.reenactment.source_image import SourceFace, feather_edges, half_size_face
from relit_camera.live.reenactment.warp import PositionGrid, Warp
from relit_camera.subject.half_size import half_size_subject
from relit_camera.subject.subject import Subject

RATIO_FLOOR = 0.03
"""Share of the room-lit face's mean that is added to both sides of the ratio: shadows stay bounded."""
MIN_CHANNEL_MEAN = 1e-3
"""Linear: the least mean of a channel under the room's light that counts; three sRGB codes."""
SURELY_THERE = 0.5
"""Presence up to which a frame does not tell where the person lies: the face may be lost, or not yet found."""
RATIO_CELLS = 120
"""The ratio is made for cells of the frame, about so many on its shorter side: it is softer than the source image."""
SMALL_FRAME_PX = 300
"""Shorter side of frames below which each pixel is such a cell."""
BOX_CELLS = 8
"""The box of what is relit of the frame begins and ends at multiples of so many cells."""
FACTORS, CASTS = (0.02, 3.0), (0.6, 1.6)
"""Limits of the mean factor of light, and of a channel's beside that of luminance: further off, a face was misread that
hardly tells its light, in a mask before a lamp say, and the whole person would glow."""


@dataclass(frozen=True)
class FaceLight:
    """The light on a face that is followed in a live frame.

    Attributes:
        gain: (3,) float32 by which the frame's exposure differs from that of the ratio, see `RoomLightEstimate`.
        cast: (3,) float32 color of the room's light on the face, of luminance 1.
        pictures: (2 · height, width, 3) float32, see `RatioRelighting.raised_lights`.
        positions: where cells of some pixels of the frame lie in the source image.
        eye_distance: in the frame, pixels.
    """

    gain: NDArray[np.float32]
    cast: NDArray[np.float32]
    pictures: NDArray[np.float32]
    positions: PositionGrid
    eye_distance: float


@dataclass(frozen=True)
class FaceCells:
    """What a face tells of some cells of a live frame.

    Attributes:
        box: left, top, right and bottom of the cells.
        ratio: (rows, columns, 4) float32, the roots of the ratio times the confidence, and the confidence.
        trust: (rows, columns) how far the live picture's detail is shown, 0..1.
        sure: (rows, columns) how surely cells show what the source image has there of the person, 0..1.
        smooth: (rows, columns, 3) roots of the live picture's light with hardly any noise.
        source: of the source image there.
        unit: the eye distance in cells.
    """

    box: Box
    ratio: Cells
    trust: Cells
    sure: Cells
    smooth: Cells
    source: SourceCells
    unit: float


class RatioRelighting:
    """What the live face of one subject tells of its light.

    Of these methods only `aligned` changes anything: it sees the frames one after another, from one thread at a time.

    Attributes:
        subject: the person.
        face: the face in the source image.
    """

    def __init__(self, subject: Subject, face: SourceFace, motion: DenseMotion) -> None:
        """Prepare for one subject. Of one that is nobody's (`Subject.is_anyone`) only the shape counts.

        Args:
            subject: the person.
            face: the face in the source image.
            motion: makes the flow between source image and live face.
        """
        self.subject, self.face = subject, face
        self._motion = motion
        self._points = control_points(face, head_and_shoulder_anchors(face.pose, face.size))
        self._mesh = triangulate_face(face)
        confidence = ratio_confidence(feather_edges(subject.matte))
        self._inside = (confidence > 0.5).astype(np.uint8)
        self._confidence = confidence
        near = near_person(confidence, face.scheme.eye_span(face.landmarks))
        self._person, self._near = limits(confidence), limits(near)
        self._parts = cv2.merge([confidence, still_skin(face), inside_face(face), near])
        self._alignment = LiveAlignment(face)

    def raised_lights(self, relit: LinearImage, under_room: LinearImage) -> NDArray[np.float32]:
        """The source image under the scene's light and, below it, under the room's: (2 · height, width, 3) float32.

        Linear; both have a little light added, so that their ratio is moderate in shadows.

        Args:
            relit: (height, width, 3) float32 linear, the source image under the scene's light.
            under_room: the same under the room's.
        """
        # A room may have no light at all of one colour; then the live picture has none of it either.
        floor = tuple(RATIO_FLOOR * max(mean, MIN_CHANNEL_MEAN) for mean in cv2.mean(under_room, self._inside))
        both = np.empty((2 * relit.shape[0], *relit.shape[1:]), np.float32)
        for picture, half in zip((relit, under_room), np.split(both, 2), strict=True):
            cv2.threshold(picture, 0, 0, cv2.THRESH_TOZERO, dst=half)
        return np.asarray(cv2.add(both, floor, dst=both), np.float32)

    def tinted(self, pictures: NDArray[np.float32], tint: NDArray[np.float32]) -> NDArray[np.float32]:
        """`raised_lights` with the relit half in another skin's color; `tint` (3,) is the factor, see `SkinTint`."""
        relit, under_room = np.split(pictures, 2)
        return np.concatenate([relit * tint, under_room])

    def mean_factor(self, pictures: NDArray[np.float32], gain: NDArray[np.float32]) -> NDArray[np.float32]:
        """The factor (3,) by which the light of the whole person is multiplied; arguments as in `FaceLight`."""
        relit, under_room = (np.array(cv2.mean(half, self._inside)[:3]) for half in np.split(pictures, 2))
        return bounded_factor(relit / np.maximum(under_room * gain, MIN_CHANNEL_MEAN))

    def positions(self, motion: FaceMotion, pose: HeadPose, size: tuple[int, int]) -> PositionGrid:
        """Where a live frame of `size` (width, height) lies in the source image.

        Args:
            motion: of the face in the frame.
            pose: of the head in the frame.
            size: of the frame.
        """
        return self._warp(motion, pose, size).grid((0, 0, *size), cell_side(size))

    def aligned(self, frame: Frame, face: FaceLight, presence: float) -> FaceLight:
        """The same light, its positions corrected by what the frame shows; see `live_alignment`.

        Args:
            frame: the live frame.
            face: the light on the face in it.
            presence: how far the face tells it, 0..1.
        """
        if self.subject.is_anyone:
            return face
        positions = face.positions
        if presence > SURELY_THERE and self._alignment.is_due(frame.time_s):
            nodes = positions.nodes() - np.float32(0.5)
            left, top, right, bottom = box = _cells_within(nodes, *self._person)
            looks = nodes[top:bottom, left:right]
            confidence = cv2.remap(self._confidence, looks, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            live, brightest = live_cells(frame.image, positions.step, box)
            confidence[overexposed(brightest)] = 0
            unit = face.eye_distance / positions.step
            cells = ComparedCells(live, _under_room(face, looks), confidence, looks, unit)
            self._alignment.update(cells, frame.time_s)
        return replace(face, positions=self._alignment.corrected(positions))

    def box(self, face: FaceLight) -> Box:
        """Left, top, right and bottom of the cells of a frame of which the face tells anything."""
        return _cells_within(face.positions.nodes() - np.float32(0.5), *self._near)

    def cells(self, image: DisplayImage, face: FaceLight, box: Box) -> FaceCells:
        """What the face tells of a box of cells of a frame."""
        step = face.positions.step
        left, top, right, bottom = box
        # cv2 counts pixel centers as integers: x_ours = x_cv + ½.
        looks = face.positions.nodes()[top:bottom, left:right] - np.float32(0.5)
        relit, parts = (
            cv2.remap(each, looks, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            for each in (np.split(face.pictures, 2)[0], self._parts)
        )
        # Roots, because the step between two of them is about as visible anywhere.
        relit, under_room = root_of_light(relit), _under_room(face, looks)
        live, brightest = live_cells(image, step, box)
        confidence, skin, on_face, near = cv2.split(parts)
        source = SourceCells(relit, under_room, confidence, skin, on_face, near)
        unit = face.eye_distance / step
        smooth = smoothed(live, unit)
        told = shape_cells(source) if self.subject.is_anyone else blend_cells(live, smooth, brightest, source, unit)
        sure = cv2.multiply(confidence, on_face) if self.subject.is_anyone else cv2.extractChannel(told.ratio, 3)
        return FaceCells(box, told.ratio, told.trust, np.asarray(sure, np.float32), smooth, source, unit)

    def _warp(self, motion: FaceMotion, pose: HeadPose, size: tuple[int, int]) -> Warp:
        """The source image as it lies on the live face of a frame of `size`.

        One similarity for the head, a dense flow for the rest.
        """
        face, chosen = self.face, self._points.chosen
        landmarks = motion.landmarks.astype(np.float64)
        live = np.vstack([landmarks[chosen], head_and_shoulder_anchors(pose, size)])
        source_from_live = fit_similarity(landmarks[list(face.scheme.rigid)], face.landmarks[list(face.scheme.rigid)])
        target = live @ source_from_live[:, :2].T + source_from_live[:, 2]
        moved = landmarks @ source_from_live[:, :2].T + source_from_live[:, 2]
        # Lids and lips are the live picture's; the light on them is that of the skin round them.
        flow = face_and_head_flow(self._motion, self._mesh, self._points, target, moved, pose)
        return Warp(source_from_live, flow)


def bounded_factor(factor: NDArray[np.floating]) -> NDArray[np.float32]:
    """A factor of light (3,) within `FACTORS` and `CASTS`."""
    level = max(float(factor @ LUMINANCE), 1e-6)
    return np.asarray(np.clip(factor / level, *CASTS) * np.clip(level, *FACTORS), np.float32)


def cell_side(size: tuple[int, int]) -> int:
    """The side in pixels of a cell of frames of `size` (width, height)."""
    return 1 if min(size) < SMALL_FRAME_PX else round(min(size) / RATIO_CELLS)


def _under_room(face: FaceLight, looks: NDArray[np.float32]) -> NDArray[np.float32]:
    """Roots (rows, columns, 3) of what the source image has under the room's light, in the frame's exposure.

    With what `RatioRelighting.raised_lights` adds. `looks` (rows, columns, 2) are source pixels, as OpenCV counts.
    """
    picture = np.split(face.pictures, 2)[1]
    light = cv2.remap(picture, looks, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return root_of_light(np.asarray(cv2.multiply(light, (*map(float, face.gain), 1.0)), np.float32))


def _cells_within(nodes: NDArray[np.float32], low: tuple[float, ...], high: tuple[float, ...]) -> Box:
    """The box of those cells that look between two points of the source image, with some more round them.

    Of all where none does. Its sides are at multiples of `BOX_CELLS`, or what is computed for fewer cells would flicker
    as it moves. `nodes` (rows, columns, 2) are where cells look, `low` and `high` x and y, all as OpenCV counts.
    """
    left, top, width, height = cv2.boundingRect(cv2.inRange(nodes, (*low, 0, 0), (*high, 0, 0)))
    rows, columns = nodes.shape[:2]
    if width == 0:
        return 0, 0, columns, rows
    right, bottom = (-(-(end + 1) // BOX_CELLS) * BOX_CELLS for end in (left + width, top + height))
    left, top = (max(start - 1, 0) // BOX_CELLS * BOX_CELLS for start in (left, top))
    return left, top, min(right, columns), min(bottom, rows)


def as_large_as_needed(subject: Subject, face: SourceFace) -> tuple[Subject, SourceFace]:
    """The subject and its face at half their size where the cells of the ratio still are no smaller than its pixels."""
    if min(subject.size) < 2 * RATIO_CELLS:
        return subject, face
    return half_size_subject(subject), half_size_face(face)


def fit_similarity(points: NDArray[np.float64], onto: NDArray[np.floating]) -> NDArray[np.float64]:
    """The rotation, scale and shift (2, 3) that bring `points` (count, 2) nearest to `onto` in least squares."""
    center, goal = points.mean(axis=0), onto.mean(axis=0)
    # As complex numbers a similarity is one factor, and least squares a quotient.
    p, q = (points - center) @ [1, 1j], (onto - goal) @ [1, 1j]
    factor = np.vdot(p, q) / max(np.vdot(p, p).real, 1e-12)
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    return np.column_stack([turn, goal - turn @ center])
