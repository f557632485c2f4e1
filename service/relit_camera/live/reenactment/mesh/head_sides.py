"""What lies beside the face in the source image, as a mesh round it: ears, hair and neck.

The face hides the ear and the hair at the far side of a turned head. A smooth flow cannot hide anything: it presses
both together beside the far cheek, which they widen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import Rotation, angles_from_rotation
from relit_camera.face.head_pose import HeadPose, project
from relit_camera.face.landmarks.landmark_triangulation import delaunay_triangles
from relit_camera.live.reenactment.control_points import BEYOND_HAIR, SHOULDERS, SKULL_ABOVE_EARS
from relit_camera.live.reenactment.mesh.triangle_drawing import doubled_areas
from relit_camera.live.reenactment.source_image import SourceFace

EAR_BESIDE_CM, EAR_BEHIND_CM = 2.0, 4.0
"""From the face's outline to the outer edge of the ear."""
CHEEK_SHARE = 0.6
"""From the middle of the face, in halves of its width, to where its outline no longer is that of chin or forehead."""
ANCHOR_DEPTH_CM = -8.0
"""Z of the anchors, head axes: behind the ears."""
RIM = 1.35
"""Size of the mesh's rim beside the ring beyond the hair: wide hair goes beyond that."""
NECK_CM = (-8.0, -5.0)
"""Y in head axes: at the height of the neck, up to which the mesh does not count, and from where on it does fully. What
is behind the jaw there, neck and collar, does not turn with the head."""
TURNED_DEG = (6.0, 16.0)
"""Yaw from which on the mesh counts at the side that turns away, and from where on fully."""


@dataclass(frozen=True)
class HeadSides:
    """The mesh round a source image's face.

    Its points are the landmarks that are corners of the face's mesh, then ears, then what `_around` makes of anchors.

    Attributes:
        ears: (count, 3) float64 head axes, cm: the outer edges of both ears, and what lies above and below them.
        triangles: (some, 3) rows of its points, the farthest first, none of them all in the face.
        clockwise: (some,) the sign of each triangle's area in the source image.
        places: (some, 3, 2) float64 source pixels of each triangle's corners.
        side: (points,) float64, −1 in the left half of the picture, 1 in the right.
        trust: (points beside the face,) float64 how far the mesh counts there once their side has turned away: 0 at its
            rim, the shoulders and beside the neck, else 1.
    """

    ears: NDArray[np.float64]
    triangles: NDArray[np.intp]
    clockwise: NDArray[np.float64]
    places: NDArray[np.float64]
    side: NDArray[np.float64]
    trust: NDArray[np.float64]

    def turned_away(self, turn: Rotation) -> NDArray[np.float64]:
        """How far each point (points,) has turned away with its side of the head, 0..1.

        Args:
            turn: of the head since the source image. A nod hides no side.
        """
        return np.asarray(smoothstep(self.side * angles_from_rotation(turn).yaw, *TURNED_DEG))

    def facing(
        self, landmarks: NDArray[np.float64], anchors: NDArray[np.float64], pose: HeadPose, size: tuple[int, int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.intp]]:
        """The triangles that face the camera, the farthest first.

        Args:
            landmarks: (landmarks, 2) where those go that are its points.
            anchors: (count, 2) where all anchors of head and shoulders go.
            pose: of the head that goes there.
            size: (width, height) of the source image.

        Returns:
            Where their corners go and where these look, (some, 3, 2) source pixels; and the corners' rows (some, 3).
        """
        points = np.vstack([landmarks, project(self.ears, pose, size), _around(anchors)])
        corners = points.take(self.triangles, axis=0)
        seen = np.flatnonzero(doubled_areas(corners) * self.clockwise > 0)
        return corners.take(seen, axis=0), self.places.take(seen, axis=0), self.triangles.take(seen, axis=0)


def triangulate_sides(face: SourceFace, members: NDArray[np.intp], anchors: NDArray[np.float64]) -> HeadSides:
    """The mesh round a source image's face.

    Args:
        face: that face.
        members: (landmarks,) those that are corners of its mesh.
        anchors: (count, 2) `head_and_shoulder_anchors` of the source image.
    """
    outline = face.head_points[list(face.scheme.oval)]
    cheeks = outline[on_cheek(outline)]
    ears = cheeks + np.sign(cheeks[:, :1]) * [EAR_BESIDE_CM, 0, 0] - [0, 0, EAR_BEHIND_CM]
    landmarks = face.landmarks[members].astype(np.float64)
    around = _around(anchors)
    points = np.vstack([landmarks, project(ears, face.pose, face.size), around])
    triangles = delaunay_triangles(points.astype(np.float32))
    triangles = triangles[(triangles >= len(members)).any(axis=1)]
    depth = np.concatenate([face.scheme.canonical[members, 2], ears[:, 2], np.full(len(around), ANCHOR_DEPTH_CM)])
    places = points[triangles]
    fixed = len(anchors[BEYOND_HAIR]) + len(anchors[SHOULDERS])  # the rim is a ring too
    # The farthest first: what lies behind is drawn first.
    order = np.argsort(depth[triangles].mean(axis=1))
    return HeadSides(
        ears=ears,
        triangles=triangles[order],
        clockwise=np.sign(doubled_areas(places[order])),
        places=places[order],
        side=np.where(points[:, 0] < landmarks[:, 0].mean(), -1.0, 1.0),
        trust=np.concatenate([above_neck(ears), np.ones(len(around) - fixed), np.zeros(fixed)]),
    )


def ear_in_sight(pose: HeadPose, turn: float) -> float:
    """How far an ear is seen beyond the face's outline, in cm; hidden it is negative.

    Args:
        pose: of the head.
        turn: any yaw that turns this ear away: above 0 for the one at the picture's right.
    """
    yaw = np.radians(angles_from_rotation(pose.rotation).yaw)
    return float(EAR_BESIDE_CM * np.cos(yaw) - EAR_BEHIND_CM * np.sign(turn) * np.sin(yaw))


def on_cheek(outline: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which points (..., 3) of a face's outline, in head axes, are that of a cheek or a temple: (...,)."""
    aside = np.abs(outline[..., 0])
    return np.asarray(aside > CHEEK_SHARE * aside.max())


def above_neck(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far points (count, 3) of the head, in head axes, lie above the height of the neck: (count,) 0..1."""
    return np.asarray(smoothstep(points[:, 1], *NECK_CM))


def _around(anchors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (count, 2) of hair, rim and shoulders from all anchors of head and shoulders."""
    ring = anchors[BEYOND_HAIR]
    middle = (ring[0] + ring[-1]) / 2
    return np.vstack([anchors[SKULL_ABOVE_EARS], ring, middle + RIM * (ring - middle), anchors[SHOULDERS]])
