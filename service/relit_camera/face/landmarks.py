"""What a landmark scheme says of its points. "Right" and "left" are the subject's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.space.images import Points

Indices = tuple[int, ...]


@dataclass(frozen=True)
class Eye:
    """Point indices of one eye.

    Attributes:
        outer: corner toward the ear.
        inner: corner toward the nose.
        lids: the closed outline of the opening: outer corner, upper lid, inner corner, lower lid.
        gap: (upper, lower) lid points near the middle whose distance is the eye's opening.
        iris: centre and ring (picture right, upper, picture left, lower), or empty.
    """

    outer: int
    inner: int
    lids: Indices
    gap: tuple[Indices, Indices]
    iris: Indices


@dataclass(frozen=True, eq=False)
class Scheme:
    """A landmark scheme.

    Attributes:
        name: as in `FaceState.scheme`.
        canonical: (count, 3) float64 centimetres in head axes, read-only: where each point lies on the mean face.
        rigid: points that hardly move with expression, for the head pose.
        right_eye, left_eye: the eyes.
        right_brow, left_brow: beginning at the outer end of the upper edge.
        upper_lip_outer, lower_lip_outer: from the right to the left mouth corner, corners included.
        upper_lip_inner, lower_lip_inner: the same of the inner edge; same length, each over its partner.
        lip_gap: (upper, lower) inner points near the middle whose distance is the mouth's opening.
        oval: outline of the face, clockwise in the picture, starting at the top.
    """

    name: str
    canonical: NDArray[np.float64]
    rigid: Indices
    right_eye: Eye
    left_eye: Eye
    right_brow: Indices
    left_brow: Indices
    upper_lip_outer: Indices
    lower_lip_outer: Indices
    upper_lip_inner: Indices
    lower_lip_inner: Indices
    lip_gap: tuple[Indices, Indices]
    oval: Indices

    @property
    def count(self) -> int:
        """How many points there are."""
        return len(self.canonical)

    @property
    def lips(self) -> Indices:
        """Every point of the lips, once."""
        edges = (*self.upper_lip_outer, *self.lower_lip_outer, *self.upper_lip_inner, *self.lower_lip_inner)
        return tuple(sorted(set(edges)))

    @property
    def eyes(self) -> Indices:
        """Every point of both eyes, irises included."""
        return (*self.right_eye.lids, *self.right_eye.iris, *self.left_eye.lids, *self.left_eye.iris)

    def eye_centres(self, landmarks: Points) -> Points:
        """(2, 2): the middle between the corners of the right and of the left eye."""
        corners = landmarks[[self.right_eye.outer, self.right_eye.inner, self.left_eye.inner, self.left_eye.outer]]
        return ((corners[0::2] + corners[1::2]) / 2).astype(np.float32)

    def eye_span(self, landmarks: Points) -> float:
        """Distance of the outer eye corners in pixels, the unit of image-plane errors ("io")."""
        return _distance(landmarks, self.right_eye.outer, self.left_eye.outer)

    def eyes_opening(self, landmarks: Points) -> tuple[float, float]:
        """Lid gap over eye width of the right and the left eye: about 0.3 open, under 0.1 shut."""
        right, left = (
            _mean_gap(landmarks, eye.gap) / _distance(landmarks, eye.outer, eye.inner)
            for eye in (self.right_eye, self.left_eye)
        )
        return right, left

    def mouth_opening(self, landmarks: Points) -> float:
        """Inner lip gap over the distance of the outer eye corners: 0 closed, 0.5 wide open."""
        return _mean_gap(landmarks, self.lip_gap) / self.eye_span(landmarks)


def _mean_gap(landmarks: Points, pairs: tuple[Indices, Indices]) -> float:
    upper, lower = pairs
    return float(np.linalg.norm(landmarks[list(upper)] - landmarks[list(lower)], axis=1).mean())


def _distance(landmarks: Points, first: int, second: int) -> float:
    # A degenerate face (all points in one place) has openings of 0, not a division by zero.
    return max(float(np.linalg.norm(landmarks[first] - landmarks[second])), 1e-6)
