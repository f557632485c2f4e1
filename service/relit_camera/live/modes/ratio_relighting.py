"""Ratio relighting: the live frame times relit(scene) / relit(room) of the subject, warped onto the live face.

The person's own mouth, eyes and texture stay in the picture; only the light is exchanged.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import LUMINANCE
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Points
from relit_camera.base.images.light_multiplication import POWER, light_of_root, multiply_light, root_of_light
from relit_camera.base.images.temporal_noise import TemporalNoiseFilter
from relit_camera.base.rotations import Rotation
from relit_camera.face.head_pose import HeadPose
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.modes.live_alignment import ComparedCells, LiveAlignment
from relit_camera.live.modes.live_detail import (
    SourceCells,
    blend_cells,
    live_cells,
    noise_fraction,
    overexposed,
    shape_cells,
    smoothed,
)
from relit_camera.live.modes.room_light_estimator import RoomLightEstimate
from relit_camera.live.modes.source_masks import inside_face, limits, near_person, ratio_confidence, still_skin
from relit_camera.live.reenactment.control_points import control_points, head_and_shoulder_anchors
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.first_order_reenactor import face_and_head_flow
from relit_camera.live.reenactment.mesh.face_mesh import triangulate_face
from relit_camera.live.reenactment.source_image import SourceFace, feather_edges, half_size_face
from relit_camera.live.reenactment.warp import Box, PositionGrid, Warp
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
EXTRAPOLATION_CELLS, WIDE_REDUCTION = 45, 4
"""The extrapolation beyond the person is computed for so many there, and its wide blurs for fewer by a factor."""

FACTORS, CASTS = (0.02, 3.0), (0.6, 1.6)
"""Limits of the mean factor of light, and of a channel's beside that of luminance: further off, a face was misread that
hardly tells its light, in a mask before a lamp say, and the whole person would glow."""


class RoomLight(Protocol):
    """What estimates the room's light; see `RoomLightEstimator`."""

    def update(self, image: DisplayImage, landmarks: Points, rotation: Rotation, time_s: float) -> RoomLightEstimate:
        """See `RoomLightEstimator.update`."""
        ...


@dataclass(frozen=True)
class FaceLight:
    """The light on a face that is followed in a live frame.

    Attributes:
        gain: (3,) float32 by which the frame's exposure differs from that of the ratio, see `RoomLightEstimate`.
        pictures: (2 · height, width, 3) float32, see `RatioRelighting.raised_lights`.
        positions: where cells of some pixels of the frame lie in the source image.
        eye_distance: in the frame, pixels.
    """

    gain: NDArray[np.float32]
    pictures: NDArray[np.float32]
    positions: PositionGrid
    eye_distance: float


@dataclass(frozen=True)
class RatioPlan:
    """What is known of one live frame before it is relit.

    Attributes:
        frame: the live frame.
        rest: (3,) float32 factor of light for a person whose face does not tell their light.
        presence: how far the face tells it, 0..1.
        face: what it tells; None where nobody is followed.
    """

    frame: Frame
    rest: NDArray[np.float32]
    presence: float = 0.0
    face: FaceLight | None = None


@dataclass(frozen=True)
class RelitFrame:
    """A live frame in another light.

    Attributes:
        image: uint8 sRGB.
        person: (rows, columns) float32, how surely cells of the frame show what the source image has there of the
            person, 0..1; None where nobody is followed.
    """

    image: DisplayImage
    person: NDArray[np.float32] | None


class RatioRelighting:
    """Exchanges the light on the live face of one subject.

    `positions`, `raised_lights` and `apply` share nothing that changes: each may run in a thread of its own. `aligned`,
    `room_light` and `apply` each see the frames one after another, from one thread at a time.

    Attributes:
        room_light: estimates the room's light from the live face.
    """

    def __init__(self, subject: Subject, face: SourceFace, room_light: RoomLight, motion: DenseMotion) -> None:
        """Prepare for one subject. Of one that is nobody's (`Subject.is_anyone`) only the shape counts.

        Args:
            subject: the person.
            face: the face in the source image.
            room_light: estimates the room's light from the live face.
            motion: makes the flow between source image and live face.
        """
        self.room_light = room_light
        self._shape_alone = subject.is_anyone
        self._face = face
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
        self._noise = TemporalNoiseFilter()

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
        return self._warp(motion, pose, size).grid((0, 0, *size), _cell_side(size))

    def aligned(self, plan: RatioPlan) -> RatioPlan:
        """The same plan, its positions corrected by what the frame shows; see `live_alignment`."""
        if plan.face is None or self._shape_alone:
            return plan
        face, positions = plan.face, plan.face.positions
        if plan.presence > SURELY_THERE and self._alignment.is_due(plan.frame.time_s):
            nodes = positions.nodes() - np.float32(0.5)
            left, top, right, bottom = box = _cells_within(nodes, *self._person)
            looks = nodes[top:bottom, left:right]
            confidence = cv2.remap(self._confidence, looks, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            live, brightest = live_cells(plan.frame.image, positions.step, box)
            confidence[overexposed(brightest)] = 0
            unit = face.eye_distance / positions.step
            cells = ComparedCells(live, _under_room(face, looks), confidence, looks, unit)
            self._alignment.update(cells, plan.frame.time_s)
        return replace(plan, face=replace(face, positions=self._alignment.corrected(positions)))

    def apply(self, plan: RatioPlan, blend: float = 1.0) -> RelitFrame:
        """The planned frame in the scene's light.

        `blend` is how far, in light: 0 gives the frame itself. Its brightest codes are taken for no more light than
        sRGB says the further it is relit: more is a guess, which the ratio would show as red blotches where skin is red
        first. Noise of the frame is removed over time in any case, where a face is followed.
        """
        image, step = plan.frame.image, _cell_side(plan.frame.size)
        rows, columns = (-(-side // step) for side in image.shape[:2])
        factor = np.empty((rows, columns, 3), np.float32)
        factor[:] = root_of_light(plan.rest[None])[0]
        added, person = np.zeros_like(factor), None
        if plan.face is not None and plan.presence > 0:
            image, told, more, person = self._face_cells(plan.frame, plan.face, whole=blend < 1)
            factor = cv2.addWeighted(told, plan.presence, factor, 1 - plan.presence, 0)
            added = more * np.float32(plan.presence)
        if blend < 1:
            live, _ = live_cells(image, step, (0, 0, columns, rows))
            factor, added = blend_toward_live(np.asarray(factor, np.float32), added, live, blend)
        return RelitFrame(multiply_light(image, factor, step, as_shown=1 - blend, added=added), person)

    def _face_cells(
        self, frame: Frame, face: FaceLight, whole: bool
    ) -> tuple[DisplayImage, NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """The frame with less noise; roots of the factor and what is added, (rows, columns, 3); the person, see above.

        What is near the person is computed, or with `whole` all cells.
        """
        step = face.positions.step
        # cv2 counts pixel centers as integers: x_ours = x_cv + ½.
        nodes = face.positions.nodes() - np.float32(0.5)
        box = (0, 0, nodes.shape[1], nodes.shape[0]) if whole else _cells_within(nodes, *self._near)
        left, top, right, bottom = box
        inside = np.s_[top:bottom, left:right]
        image = self._noise.filtered(frame.image, _pixels_of(box, step, frame.size))
        relit, parts = (
            cv2.remap(each, nodes[inside], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            for each in (np.split(face.pictures, 2)[0], self._parts)
        )
        # Roots, because the step between two of them is about as visible anywhere.
        relit, under_room = root_of_light(relit), _under_room(face, nodes[inside])
        live, brightest = live_cells(image, step, box)
        confidence, skin, on_face, near = cv2.split(parts)
        source = SourceCells(relit, under_room, confidence, skin, on_face, near)
        unit = face.eye_distance / step
        smooth = smoothed(live, unit)
        cells = shape_cells(source) if self._shape_alone else blend_cells(live, smooth, brightest, source, unit)
        beside = (top, nodes.shape[0] - bottom, left, nodes.shape[1] - right)
        factor = extrapolate_roots(cv2.copyMakeBorder(cells.ratio, *beside, cv2.BORDER_CONSTANT))
        trust = cv2.cvtColor(cells.trust, cv2.COLOR_GRAY2RGB)
        added = cv2.multiply(relit, 1 - trust)
        factor[inside] *= trust
        noise = noise_fraction(image, step, box, factor[inside], source, unit)
        calm = cv2.multiply(factor[inside], cv2.cvtColor(noise, cv2.COLOR_GRAY2RGB))
        factor[inside] -= calm
        added += cv2.multiply(calm, smooth)
        sure = confidence * on_face if self._shape_alone else cv2.extractChannel(cells.ratio, 3)
        added, person = (cv2.copyMakeBorder(each, *beside, cv2.BORDER_CONSTANT) for each in (added, sure))
        return image, factor, np.asarray(added, np.float32), np.asarray(person, np.float32)

    def _warp(self, motion: FaceMotion, pose: HeadPose, size: tuple[int, int]) -> Warp:
        """The source image as it lies on the live face of a frame of `size`.

        One similarity for the head, a dense flow for the rest.
        """
        face, chosen = self._face, self._points.chosen
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


def _cell_side(size: tuple[int, int]) -> int:
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


def _pixels_of(cells: Box, step: int, size: tuple[int, int]) -> Box:
    """The box of a frame's pixels, of `size` (width, height), that cells of `step` pixels show."""
    left, top, right, bottom = (step * side for side in cells)
    return left, top, min(right, size[0]), min(bottom, size[1])


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


def blend_toward_live(
    factor: NDArray[np.float32], added: NDArray[np.float32], live: NDArray[np.float32], share: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What a root x is multiplied by, and what is added to it, where a `share` in light of x · factor + added is shown.

    The rest is x itself. The mixture in light is not linear in x: it is so near `live`, the cells' own root, and
    everywhere where nothing is added. All are (rows, columns, 3).
    """
    live = np.maximum(live, np.float32(1e-3))
    relit = live * factor + added
    mixed = np.maximum(((1 - share) * live**POWER + share * relit**POWER) ** (1 / POWER), 1e-3)
    toward_live, toward_relit = (1 - share) * (live / mixed) ** (POWER - 1), share * (relit / mixed) ** (POWER - 1)
    return np.asarray(toward_live + toward_relit * factor, np.float32), np.asarray(toward_relit * added, np.float32)


def extrapolate_roots(warped: NDArray[np.float32]) -> NDArray[np.float32]:
    """Extrapolate a ratio that is known only on the person to the whole frame: its roots (height, width, 3) float32.

    Beyond the person it goes on smoothly: wide blurs of what is known, divided by the blurred weight, as light.

    Args:
        warped: (height, width, 4): roots of the ratio times weight, and the weight.
    """
    height, width = warped.shape[:2]
    small = _shrunk(warped, max(min(height, width) / EXTRAPOLATION_CELLS, 1))
    roots, weight = small[..., :3], small[..., 3:]
    small[..., :3] = light_of_root(roots / (weight + np.float32(1e-9))) * weight
    # Narrow blurs win where they have weight: detail near the person, the mean far away. Wide ones need fewer pixels.
    wide: NDArray = _sum_of_blurs(_shrunk(small, WIDE_REDUCTION), {2.0: 1 / 8**3, 5.0: 1 / 20**3})
    spread = cv2.add(
        _sum_of_blurs(small, {1.0: 1.0, 3.0: 1 / 3**3}),
        cv2.resize(wide, small.shape[1::-1], interpolation=cv2.INTER_LINEAR),
    )
    beyond = root_of_light((spread[..., :3] + np.float32(1e-9)) / (spread[..., 3:] + np.float32(1e-9)))
    beyond = cv2.resize(beyond, (width, height), interpolation=cv2.INTER_LINEAR)
    cover = cv2.cvtColor(cv2.extractChannel(warped, 3), cv2.COLOR_GRAY2RGB)
    known = cv2.cvtColor(warped, cv2.COLOR_RGBA2RGB)
    cv2.subtract(beyond, cv2.multiply(cover, beyond, dst=cover), dst=beyond)
    return np.asarray(cv2.add(known, beyond, dst=known), np.float32)


def _shrunk(picture: NDArray[np.float32], factor: float) -> NDArray[np.float32]:
    size = [max(int(side / factor), 1) for side in picture.shape[1::-1]]
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32)


def _sum_of_blurs(picture: NDArray[np.float32], shares: Mapping[float, float]) -> NDArray[np.float32]:
    """A picture blurred by each of some sigmas, summed by their shares."""
    total = np.zeros_like(picture)
    for sigma, share in shares.items():
        blurred = cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
        total = cv2.scaleAdd(blurred, share, total, dst=total)
    return np.asarray(total, np.float32)
