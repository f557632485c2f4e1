"""Landmark schemes: the number of points a tracker gives, their meaning, and their positions on the canonical face.

"Right" and "left" are the subject's: the right eye is at the left of an unmirrored picture.

- `mesh478`: points 0-467 are the vertices of the canonical face, 468-472 the right iris and 473-477 the left one
  (centre, then the ring's picture-right, upper, picture-left and lower point).
- `openseeface66`: the usual 68-point scheme (iBUG 300-W) without its two *outer* mouth corners: 0-16 jaw line, 17-26
  brows, 27-35 nose, 36-47 eyes, 48-57 outer lips, 58 and 62 mouth corners, 59-61 and 63-65 inner lips.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import NotFoundError
from relit_camera.base.images.image_types import Points
from relit_camera.face.landmarks.canonical_face import canonical_face

Indices = tuple[int, ...]


@dataclass(frozen=True)
class EyeLandmarks:
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
class LandmarkScheme:
    """A landmark scheme: its points by meaning, as indices.

    Attributes:
        name: as in `FaceState.scheme`.
        canonical: (count, 3) float64 centimetres in head axes, read-only: where each point lies on the mean face.
        rigid: points that hardly move with expression, for the head pose.
        right_eye, left_eye: the eyes.
        nose_tip: the point that is nearest to the camera.
        right_brow, left_brow: beginning at the outer end of the upper edge.
        upper_lip_outer, lower_lip_outer: from the right to the left mouth corner, corners included.
        upper_lip_inner, lower_lip_inner: of the inner edge, of equal length, point by point above each other.
        lip_gap: (upper, lower) inner points near the middle whose distance is the mouth's opening.
        oval: outline of the face, clockwise in the picture, starting at the top.
    """

    name: str
    canonical: NDArray[np.float64]
    rigid: Indices
    right_eye: EyeLandmarks
    left_eye: EyeLandmarks
    nose_tip: int
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
        """Number of points."""
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

    @cached_property
    def rigid_indices(self) -> NDArray[np.intp]:
        """`rigid` as an array."""
        return np.array(self.rigid)

    @cached_property
    def rigid_canonical(self) -> NDArray[np.float64]:
        """(rigid, 3) centimetres in head axes: the rigid points on the mean face."""
        return self.canonical[self.rigid_indices]

    @cached_property
    def _outer_corners(self) -> NDArray[np.intp]:
        """Outer corner of the right and of the left eye."""
        return np.array([self.right_eye.outer, self.left_eye.outer])

    @cached_property
    def _eye_corners(self) -> NDArray[np.intp]:
        """(2, 2): outer and inner corner of the right and of the left eye."""
        return np.array([[eye.outer, eye.inner] for eye in (self.right_eye, self.left_eye)])

    @cached_property
    def _lid_gaps(self) -> NDArray[np.intp]:
        """(2, 2, pairs): upper and lower lid of the right and of the left eye."""
        return np.array([self.right_eye.gap, self.left_eye.gap])

    @cached_property
    def _lip_gap(self) -> NDArray[np.intp]:
        """(2, pairs): upper and lower lip."""
        return np.array(self.lip_gap)

    def eye_centers(self, landmarks: Points) -> Points:
        """(2, 2): the middle between the corners of the right and of the left eye."""
        corners = landmarks[self._eye_corners]
        return ((corners[:, 0] + corners[:, 1]) / 2).astype(np.float32)

    def eyes_center(self, landmarks: Points) -> tuple[float, float]:
        """X and y of the middle between the four corners of both eyes."""
        corners = landmarks[self._eye_corners.ravel()].tolist()
        return sum(x for x, _ in corners) / 4, sum(y for _, y in corners) / 4

    def eye_span(self, landmarks: Points) -> float:
        """Distance of the outer eye corners in pixels, the unit of image-plane errors ("io")."""
        return max(math.dist(*landmarks[self._outer_corners].tolist()), _SHORTEST)

    # A few points at a time: Python's floats take a fraction of the time of NumPy's arrays.

    def eyes_opening(self, landmarks: Points) -> tuple[float, float]:
        """Lid gap over eye width of the right and the left eye: about 0.3 open, under 0.1 shut."""
        gaps, widths = landmarks[self._lid_gaps].tolist(), landmarks[self._eye_corners].tolist()
        right, left = (
            _mean_distance(*gap) / max(math.dist(*width), _SHORTEST) for gap, width in zip(gaps, widths, strict=True)
        )
        return right, left

    def mouth_opening(self, landmarks: Points) -> float:
        """Inner lip gap over the distance of the outer eye corners: 0 closed, 0.5 wide open."""
        return _mean_distance(*landmarks[self._lip_gap].tolist()) / self.eye_span(landmarks)


_SHORTEST = 1e-6
"""A degenerate face (all points in one place) has openings of 0, not a division by zero."""


def _mean_distance(upper: list[list[float]], lower: list[list[float]]) -> float:
    return sum(map(math.dist, upper, lower)) / len(upper)


IRIS_RADIUS_CM = 0.585
"""Half the horizontal visible iris diameter, 11.7 mm, which hardly differs between people."""

VERTICES_66 = (
    *(127, 234, 93, 132, 172, 136, 150, 176, 152, 400, 379, 365, 397, 361, 323, 454, 356),  # jaw line
    *(70, 63, 105, 66, 107, 336, 296, 334, 293, 300),  # brows
    *(6, 197, 5, 4, 75, 97, 2, 326, 305),  # nose
    *(33, 160, 157, 133, 153, 163, 362, 384, 387, 263, 390, 380),  # eyes
    *(39, 37, 0, 267, 269, 321, 405, 17, 181, 91),  # outer lips
    *(61, 81, 13, 311, 291, 402, 14, 178),  # mouth corners and inner lips
)
"""The canonical vertex of each of the 66 points: the usual 68-point correspondence, corrected where the two networks,
run on the same faces, put another vertex nearer."""


def landmark_scheme(name: str) -> LandmarkScheme:
    """Look up a scheme by name.

    Raises:
        NotFoundError: there is none.
    """
    if name not in _BUILDERS:
        raise NotFoundError(f"unknown landmark scheme '{name}'", f"use one of {', '.join(_BUILDERS)}")
    return _BUILDERS[name]()


@lru_cache(maxsize=1)
def _mesh478() -> LandmarkScheme:
    right = EyeLandmarks(
        outer=33,
        inner=133,
        lids=(33, 246, 161, 160, 159, 158, 157, 173, 133, 155, 154, 153, 145, 144, 163, 7),
        gap=((160, 159, 158), (144, 145, 153)),
        iris=(468, 469, 470, 471, 472),
    )
    left = EyeLandmarks(
        outer=263,
        inner=362,
        lids=(263, 466, 388, 387, 386, 385, 384, 398, 362, 382, 381, 380, 374, 373, 390, 249),
        gap=((387, 386, 385), (373, 374, 380)),
        iris=(473, 474, 475, 476, 477),
    )
    vertices = canonical_face().vertices
    irises = [_iris_points(vertices[[eye.outer, eye.inner]]) for eye in (right, left)]
    return LandmarkScheme(
        name="mesh478",
        canonical=_read_only(np.concatenate([vertices, *irises])),
        # Forehead, temples, nose, eye corners, cheek bones and jaw hinges.
        rigid=(
            *(4, 6, 10, 33, 54, 67, 117, 119, 121, 127, 129, 132, 133, 136, 143, 147, 198, 205),
            *(263, 284, 297, 346, 348, 350, 356, 358, 361, 362, 365, 372, 376, 420, 425),
        ),
        right_eye=right,
        left_eye=left,
        nose_tip=4,
        right_brow=(70, 63, 105, 66, 107, 55, 65, 52, 53, 46),
        left_brow=(300, 293, 334, 296, 336, 285, 295, 282, 283, 276),
        upper_lip_outer=(61, 185, 40, 39, 37, 0, 267, 269, 270, 409, 291),
        lower_lip_outer=(61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291),
        upper_lip_inner=(78, 191, 80, 81, 82, 13, 312, 311, 310, 415, 308),
        lower_lip_inner=(78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308),
        lip_gap=((82, 13, 312), (87, 14, 317)),
        oval=(
            *(10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377),
            *(152, 148, 176, 149, 150, 136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109),
        ),
    )


@lru_cache(maxsize=1)
def _openseeface66() -> LandmarkScheme:
    return LandmarkScheme(
        name="openseeface66",
        canonical=_read_only(canonical_face().vertices[list(VERTICES_66)]),
        # Nose, eye corners, and the jaw hinges for a base as wide as the head.
        rigid=(1, 15, 27, 28, 29, 30, 31, 32, 33, 34, 35, 36, 39, 42, 45),
        right_eye=EyeLandmarks(outer=36, inner=39, lids=(36, 37, 38, 39, 40, 41), gap=((37, 38), (41, 40)), iris=()),
        left_eye=EyeLandmarks(outer=45, inner=42, lids=(45, 44, 43, 42, 47, 46), gap=((44, 43), (46, 47)), iris=()),
        nose_tip=30,
        right_brow=(17, 18, 19, 20, 21),
        left_brow=(26, 25, 24, 23, 22),
        upper_lip_outer=(58, 48, 49, 50, 51, 52, 62),
        lower_lip_outer=(58, 57, 56, 55, 54, 53, 62),
        upper_lip_inner=(58, 59, 60, 61, 62),
        lower_lip_inner=(58, 65, 64, 63, 62),
        lip_gap=((59, 60, 61), (65, 64, 63)),
        oval=(22, 23, 24, 25, 26, 16, 15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 17, 18, 19, 20, 21),
    )


def _iris_points(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(5, 3) centre and ring of an iris looking ahead, between the two eye corners (2, 3)."""
    # The cornea bulges before the line between the corners by about its own radius.
    center = corners.mean(axis=0) + np.array([0.0, 0.0, IRIS_RADIUS_CM])
    ring = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
    return np.asarray(center + IRIS_RADIUS_CM * ring)


def _read_only(points: NDArray[np.float64]) -> NDArray[np.float64]:
    points.setflags(write=False)
    return points


_BUILDERS = {"mesh478": _mesh478, "openseeface66": _openseeface66}
