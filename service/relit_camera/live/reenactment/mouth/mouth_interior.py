"""Drawing the inside of a mouth that the source image has closed: teeth, gums and tongue before a dark cavity.

A warp can only stretch the line between closed lips. What lies behind it was never captured, so a mouth of mean size is
drawn, lit through the lips, and only as far as they part more than in the source image. The upper teeth stay with the
skull, the lower ones and the tongue move with the jaw.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_types import DisplayImage, LinearImage, RgbaImage
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.base.rotations import Rotation
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.live.reenactment.mouth.dental_arch import LOWER_TEETH, UPPER_TEETH
from relit_camera.live.reenactment.mouth.ray_crossing import first_crossing, share_at_outline
from relit_camera.live.reenactment.source_image import SourceFace

TEETH = np.array([0.78, 0.7, 0.58], np.float32)
GUMS = np.array([0.42, 0.18, 0.16], np.float32)
TONGUE = np.array([0.55, 0.25, 0.23], np.float32)
CAVITY = np.array([0.035, 0.014, 0.012], np.float32)
"""Linear, in the exposure of the source image, as white light from the front shows them. Of the cavity only light that
its walls have reflected is seen: it is dark, and red rather than black."""
REFLECTED = np.array([0.14, 0.08, 0.07], np.float32)
"""Of the light before the lips, what lips and walls reflect to anything within."""
_COLORS = np.stack([TEETH, GUMS, TONGUE, *(color * REFLECTED for color in (TEETH, GUMS, TONGUE)), CAVITY])
UPPER_FRONT_CM, LOWER_FRONT_CM = (-0.2, -0.4), (-0.2, -0.65)
"""Y and z of the biting edges of the front teeth, jaws closed, from the line at which closed lips meet, head axes."""
JAW_JOINT_CM = np.array([[0.0], [3.5], [-9.5]], np.float32)
"""A point of the axis about which the jaw turns, from that line."""
MOST_JAW_TURN = np.radians(28.0)
TONGUE_CENTER_CM = np.array([[0.0], [-1.15], [-3.2]], np.float32)
TONGUE_RADII_CM = np.array([[1.9], [1.0], [2.3]], np.float32)
"""An ellipsoid behind the lower teeth, jaws closed, from that line."""
LEAST_DEPTH_CM = 0.15
"""Behind the lips: what touches them is lit as if it lay a little deeper."""
NARROWING_PER_CM = 0.25
"""Deeper points see more of the opening's middle: by how much less they lie aside, as it counts for their light."""
OPENING_COLUMNS = 64
FULL_OPENING = 0.05
"""Gap, in eye distances, from which the inside is fully shown; it fades in from 0."""
SUBPIXEL_BITS = 4


@dataclass(frozen=True)
class _MouthView:
    """How the camera sees a mouth, as if from far away.

    Attributes:
        lips: (3,) where closed lips meet in the middle, head axes, cm: the origin of all points here.
        place: (2,) the same in the output, pixels.
        to_head: (3, 2) float32: from a displacement in the output, pixels, to that in head axes, cm, at right angles to
            the line of sight.
        direction: (3,) float32 unit vector in head axes, away from the camera.
        pixel_cm: size of a pixel there.
    """

    lips: NDArray[np.float64]
    place: NDArray[np.float64]
    to_head: NDArray[np.float32]
    direction: NDArray[np.float32]
    pixel_cm: float

    def points(self, pixels: NDArray[np.floating]) -> NDArray[np.float32]:
        """A point on the line of sight of each pixel (count, 2): (3, count) cm, in head axes."""
        return np.asarray(self.to_head @ (pixels - self.place).astype(np.float32).T)

    def at_depth(self, pixels: NDArray[np.floating], depth: NDArray[np.floating]) -> NDArray[np.float32]:
        """The points (3, count) on the lines of sight whose z is `depth` (count,)."""
        points = self.points(pixels)
        steps = (depth - points[2]) / min(float(self.direction[2]), -0.2)
        return np.asarray(points + steps * self.direction[:, None], np.float32)

    def drop(self, pixels: NDArray[np.floating]) -> float:
        """Centimetres down the head by which a point has moved, from its motion (2,) in the output."""
        moved = self.to_head @ pixels.astype(np.float32)
        return -float(moved[1]) / max(1 - float(self.direction[1]) ** 2, 0.1)


class _Opening:
    """The strip between the lips through which light passes."""

    def __init__(self, upper: NDArray[np.float32], lower: NDArray[np.float32]) -> None:
        """`upper` and `lower` are the lips' inner edges (3, count), cm, from one corner of the mouth to the other."""
        across = np.maximum.accumulate((upper[0] + lower[0]) / 2)
        columns = np.linspace(across[0], across[-1], OPENING_COLUMNS)
        self._first, self._per_cm = np.float32(columns[0]), np.float32(1 / max(columns[1] - columns[0], 1e-6))
        self._edges = [np.interp(columns, across, edge[1]).astype(np.float32) for edge in (upper, lower)]

    def light(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """Share of the light before the lips that reaches `points` (3, count) on surfaces that face forward.

        The form factor of the strip between the lips, as if it went on to both sides.
        """
        depth = np.maximum(-points[2], np.float32(LEAST_DEPTH_CM))
        x = points[0] / (1 + np.float32(NARROWING_PER_CM) * depth)
        column = np.clip((x - self._first) * self._per_cm, 0, OPENING_COLUMNS - 1).astype(np.intp)
        # The sines of the angles under which the strip's edges are seen, upward positive.
        above, below = (edge.take(column) - points[1] for edge in self._edges)
        square = depth * depth
        share = above / np.sqrt(above * above + square) - below / np.sqrt(below * below + square)
        return np.asarray(np.maximum(share, 0) / 2, np.float32)


class MouthInterior:
    """Draws the inside of the mouth of one source image."""

    def __init__(self, face: SourceFace, neutral: DisplayImage) -> None:
        """`neutral` is the source image, uint8 sRGB, softly lit from the front: the lips' look in white light."""
        scheme = face.scheme
        self._face = face
        self._upper, self._lower = list(scheme.upper_lip_inner), list(scheme.lower_lip_inner)
        self._middle = [index for edge in scheme.lip_gap for index in edge]
        self._source_gap = self._gap(face.landmarks)
        lips = np.round(face.landmarks[list(scheme.lips)] - 0.5).astype(int)
        self._lips = np.clip(lips, 0, np.array(face.size) - 1)
        self._white = np.maximum(linear_from_uint8(neutral)[self._lips[:, 1], self._lips[:, 0]].mean(axis=0), 0.02)

    def draw(
        self,
        image: RgbaImage,
        relit: LinearImage,
        landmarks: NDArray[np.float64],
        pose: HeadPose,
        to_output: NDArray[np.float64],
    ) -> None:
        """Draw into the moved picture, in place; its alpha stays.

        Args:
            image: (height, width, 4) the moved picture, as the display shows it.
            relit: the relit source image, for the light at the lips.
            landmarks: (count, 2) moved landmarks in source pixels.
            pose: the moved head's pose in the source image's camera.
            to_output: (2, 3) source pixels → pixels of `image`.
        """
        shown = float(np.clip((self._gap(landmarks) - self._source_gap) / FULL_OPENING, 0, 1))
        if shown == 0:
            return
        opening = _transform(to_output, np.vstack([landmarks[self._upper], landmarks[self._lower][::-1]]))
        low = np.maximum(np.floor(opening.min(axis=0)).astype(int) - 3, 0)
        high = np.minimum(np.ceil(opening.max(axis=0)).astype(int) + 4, [image.shape[1], image.shape[0]])
        if (high - low < 3).any():
            return
        shape = (int(high[1] - low[1]), int(high[0] - low[0]))
        softness = max(0.02 * float(np.ptp(opening[:, 0])), 0.5)
        hole = _polygon(opening - low, shape, softness).ravel()
        # Only the pixels of the hole: it fills half of its bounding box.
        pixels = np.flatnonzero(hole)
        if pixels.size == 0:
            return
        places = np.column_stack([pixels % shape[1], pixels // shape[1]]) + low + 0.5
        light = relit[self._lips[:, 1], self._lips[:, 0]].mean(axis=0) / self._white
        inside = self._colors(places, landmarks, pose, to_output) * light
        area = np.s_[low[1] : high[1], low[0] : high[0]]
        drawn = image[area].reshape(-1, 4)
        around = linear_from_display(np.ascontiguousarray(drawn.take(pixels, axis=0)[None, :, :3]))
        share = hole.take(pixels)[:, None] * np.float32(shown)
        drawn[pixels, :3] = display_from_linear(np.asarray(around + share * (inside - around), np.float32))[0]
        image[area] = drawn.reshape(*shape, 4)

    def _gap(self, landmarks: NDArray) -> float:
        return self._face.scheme.mouth_opening(landmarks.astype(np.float32))

    def _colors(
        self,
        places: NDArray[np.float64],
        landmarks: NDArray[np.float64],
        pose: HeadPose,
        to_output: NDArray[np.float64],
    ) -> NDArray[np.float32]:
        """What is seen at some `places` (count, 2) of the output, linear (count, 3), the light before the lips as 1."""
        view = self._view(pose, to_output)
        opening, jaw = self._opening(view, landmarks, to_output), self._jaw(view, landmarks, pose, to_output)
        rays, direction = view.points(places), view.direction
        jaw_rays, jaw_direction = jaw.T @ (rays - JAW_JOINT_CM) + JAW_JOINT_CM, jaw.T @ direction
        upper = UPPER_TEETH.seen(rays, direction, UPPER_FRONT_CM, view.pixel_cm)
        lower = LOWER_TEETH.seen(jaw_rays, jaw_direction, LOWER_FRONT_CM, view.pixel_cm)
        tongue, tongue_facing, tongue_share = _meet_tongue(jaw_rays, jaw_direction)
        on_upper = opening.light(upper.points) * upper.toward_front
        on_lower, on_tongue = (
            opening.light(jaw @ (points - JAW_JOINT_CM) + JAW_JOINT_CM) * facing
            for points, facing in ((lower.points, lower.toward_front), (tongue, tongue_facing))
        )
        # From front to back, each in what those before it leave.
        behind_upper = 1 - upper.teeth - upper.gum
        behind_lower = behind_upper * (1 - lower.teeth - lower.gum)
        teeth = upper.teeth * upper.shade, behind_upper * lower.teeth * lower.shade
        gums = upper.gum, behind_upper * lower.gum
        tongue_share = behind_lower * tongue_share
        amounts = np.stack(
            [
                teeth[0] * on_upper + teeth[1] * on_lower,
                gums[0] * on_upper + gums[1] * on_lower,
                tongue_share * on_tongue,
                teeth[0] + teeth[1],
                gums[0] + gums[1],
                tongue_share,
                behind_lower - tongue_share,
            ]
        )
        return np.asarray(amounts.T @ _COLORS, np.float32)

    def _view(self, pose: HeadPose, to_output: NDArray[np.float64]) -> _MouthView:
        lips = self._face.head_points[self._middle].mean(axis=0)
        seen = _transform(to_output, project(np.vstack([lips, lips + np.eye(3)]), pose, self._face.size))
        a_centimetre = (seen[1:] - seen[0]).T
        away = pose.rotation.inv().apply(pose.rotation.apply(lips) + pose.translation)
        return _MouthView(
            lips=lips,
            place=seen[0],
            to_head=np.linalg.pinv(a_centimetre).astype(np.float32),
            direction=(away / np.linalg.norm(away)).astype(np.float32),
            pixel_cm=1 / max(float(np.linalg.norm(a_centimetre, axis=0).max()), 1e-6),
        )

    def _opening(self, view: _MouthView, landmarks: NDArray[np.float64], to_output: NDArray[np.float64]) -> _Opening:
        edges = []
        for edge in (self._upper, self._lower):
            depth = self._face.head_points[edge, 2] - view.lips[2]
            edges.append(view.at_depth(_transform(to_output, landmarks[edge]), depth))
        return _Opening(*edges)

    def _jaw(
        self, view: _MouthView, landmarks: NDArray[np.float64], pose: HeadPose, to_output: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """The rotation (3, 3) of the opened jaw.

        It carries the lower lip. A smile parts the lips too, by as much up as down, and leaves the jaw as it is; the
        chin, where trackers put it, tells the two apart less well.
        """
        closed = project(self._face.head_points[self._middle], pose, self._face.size)
        moved = (landmarks[self._middle] - closed).reshape(2, -1, 2).mean(axis=1) @ to_output[:, :2].T
        upper, lower = (view.drop(each) for each in moved)
        angle = float(np.clip((lower - max(-upper, 0.0)) / -JAW_JOINT_CM[2, 0], 0, MOST_JAW_TURN))
        return Rotation.from_rotvec(np.array([angle, 0, 0])).as_matrix().astype(np.float32)


def _meet_tongue(
    rays: NDArray[np.float32], direction: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Where rays meet the tongue, (3, count), how far it faces forward there, and which share of a pixel it fills."""
    start, along = (rays - TONGUE_CENTER_CM) / TONGUE_RADII_CM, direction / TONGUE_RADII_CM[:, 0]
    steps, met = first_crossing(start, along)
    sphere = start + steps * along[:, None]
    normals = sphere / TONGUE_RADII_CM
    normals /= np.linalg.norm(normals, axis=0) + np.float32(1e-9)
    facing = np.clip(np.float32(0.3) + np.float32(0.7) * normals[2], 0, 1)
    points = sphere * TONGUE_RADII_CM + TONGUE_CENTER_CM
    return np.asarray(points, np.float32), np.asarray(facing, np.float32), share_at_outline(normals, direction) * met


def _transform(affine: NDArray[np.float64], points: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.asarray(points @ affine[:, :2].T + affine[:, 2])


def _polygon(points: NDArray[np.float64], shape: tuple[int, int], softness: float) -> NDArray[np.float32]:
    mask = np.zeros(shape, dtype=np.uint8)
    corners = np.round((points - 0.5) * (1 << SUBPIXEL_BITS)).astype(np.int32)
    cv2.fillPoly(mask, [corners], 255, lineType=cv2.LINE_AA, shift=SUBPIXEL_BITS)
    return np.asarray(cv2.GaussianBlur(mask, (0, 0), softness).astype(np.float32) / np.float32(255), dtype=np.float32)
