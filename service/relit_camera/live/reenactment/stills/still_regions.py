"""The parts of the face that expression stills show, as meshes of landmarks that fade out at their rims."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.easing import smoothstep
from relit_camera.base.rotations import Rotation
from relit_camera.face.landmarks.canonical_face import canonical_face
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme
from relit_camera.live.reenactment.mesh.triangle_drawing import doubled_areas, draw_triangles
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.subject.expression_stills import ExpressionStill

MOUTH_RIM_CM, EYE_RIM_CM = (0.5, 2.2), (0.3, 1.1)
"""From lips and lids: up to where a still shows fully, and from where on not at all."""
MIDDLE_RIM_CM = (0.5, 2.5)
"""From the middle of a turned face outward: from where on a still begins to show, and from where on fully. Between them
the source image is as good, and sharper."""
OUTLINE_RIM_CM = 0.9
"""Inside the face's outline, over which a mouth's still fades out."""
TURNED_RIM_CM = 1.2
"""The same of a turned face: over less, its rim is seen as a line along the near jaw."""

STILL_RIM_SPANS = (0.03, 0.14)
"""Distance of the outer eye corners inside the face's outline in a still: from where on it shows, and up to where
fully."""
HIDDEN_SPANS = (0.14, 0.05)
"""How far from its own place a landmark shows another part of the face: from where on it is hidden, and up to where it
is wholly seen. A triangle is as large."""
BEHIND_CM = 20.0
"""What spans lips or lids is drawn before all else, as if so far behind."""


@dataclass(frozen=True)
class StillRegion:
    """A part of the face.

    Attributes:
        name: `mouth`, `right_eye`, `left_eye`, or the cheeks and temples of a face that is turned to a side,
            `right_turn` or `left_turn`; right and left are the person's.
        triangles: (count, 3) landmark indices, some beyond the rim.
        between: (count,) whether a triangle spans lids or lips: it lies behind them and may be flat, or turned over.
        middles: (count, 3) float64 head axes, cm.
        trust: (landmarks,) float64, how far a still shows there: 1 inside, 0 at the rim and beyond.
        eye: (landmarks,) float64, how far that belongs to the eye that turns away; elsewhere 0.
        near: (landmarks,) bool, whether that lies on the side that turns toward the camera.
    """

    name: str
    triangles: NDArray[np.int32]
    between: NDArray[np.bool_]
    middles: NDArray[np.float64]
    trust: NDArray[np.float64]
    eye: NDArray[np.float64]
    near: NDArray[np.bool_]

    @property
    def is_turn(self) -> bool:
        """Whether it belongs to a turned face: it is `right_turn` or `left_turn`."""
        return self.name.endswith("_turn")

    @property
    def eye_name(self) -> str:
        """Of a turned face, the region of the eye that turns away; of others, their own name."""
        return self.name.replace("turn", "eye")


def still_regions(scheme: LandmarkScheme) -> tuple[StillRegion, ...]:
    """The regions of scheme `mesh478`, whose mesh is the canonical face's, in the order in which they are drawn."""
    triangles = canonical_face().triangles  # the insides of mouth and eyes among them
    canonical = scheme.canonical
    flat = canonical[:, :2]
    to_outline = _nearest(flat, flat[list(scheme.oval)])
    right_eye, left_eye = (_around(canonical, eye.lids, EYE_RIM_CM) for eye in (scheme.right_eye, scheme.left_eye))
    mouth = _around(canonical, scheme.lips, MOUTH_RIM_CM)
    cheeks = smoothstep(to_outline, 0, TURNED_RIM_CM) * smoothstep(np.abs(canonical[:, 0]), *MIDDLE_RIM_CM)
    right, left = canonical[:, 0] < 0, canonical[:, 0] > 0
    nothing, nowhere = np.zeros(len(canonical)), np.zeros(len(canonical), np.bool_)
    parts = {  # trust, eye, near: the near eye and mouth do what the driver's do, which those of a still do not
        "right_turn": (cheeks * (1 - left * np.maximum(left_eye, mouth)), right_eye, left),
        "left_turn": (cheeks * (1 - right * np.maximum(right_eye, mouth)), left_eye, right),
        "mouth": (mouth * smoothstep(to_outline, 0, OUTLINE_RIM_CM), nothing, nowhere),
        "right_eye": (right_eye, nothing, nowhere),
        "left_eye": (left_eye, nothing, nowhere),
    }
    between = spans_a_gap(triangles, scheme)
    regions = []
    for name, (trust, eye, near) in parts.items():
        # Of a turned face all: the nose hides a part of the cheek.
        used = (trust[triangles] > 0).any(axis=1) | near.any()
        part = triangles[used]
        regions.append(StillRegion(name, part, between[used], canonical[part].mean(axis=1), trust, eye, near))
    return tuple(regions)


def facing(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which triangles (count, 3, 2), in pixels, turn their front to the camera: (count,)."""
    return doubled_areas(corners) < 0  # counter-clockwise where y goes up


def shown_landmarks(still: ExpressionStill, face: SourceFace, placed: NDArray[np.float32]) -> NDArray[np.float64]:
    """How far each landmark's surroundings are seen in a still, 0..1 (count,).

    Not where a nearer part of the face hides them, and less toward the outline of the face in the still: landmarks err
    by a pixel or two, and behind the outline is the room. `placed` is what `face_in_still` gives for the same still.
    """
    scheme, span = face.scheme, face.scheme.eye_span(face.landmarks)
    x, y, drawn = placed
    column, row = np.clip(still.landmarks.astype(int), 0, np.array(drawn.shape[::-1]) - 1).T
    aside = np.hypot(x[row, column] - face.landmarks[:, 0], y[row, column] - face.landmarks[:, 1]) / span
    seen = smoothstep(aside.astype(np.float64), *HIDDEN_SPANS)
    seen[[*scheme.eyes, *scheme.lips]] = 1  # shut lids and lips lie on each other
    depth = cv2.distanceTransform((drawn > 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inside = depth[row, column] / scheme.eye_span(still.landmarks)
    return np.asarray(smoothstep(inside.astype(np.float64), *STILL_RIM_SPANS) * seen)


def face_in_still(still: ExpressionStill, face: SourceFace) -> NDArray[np.float32]:
    """Where pixels of a still lie in the source image, x and y, and 1 where the face is, else 0: (3, rows, columns).

    Of parts of the face behind each other the nearest counts. What spans lips and lids, and may be flat or turned over,
    lies behind all.
    """
    triangles = canonical_face().triangles
    corners = (still.landmarks.astype(np.float64) - 0.5)[triangles]
    rotation = Rotation.from_rotvec(still.rotation.astype(np.float64)) * face.pose.rotation
    nearness = face.scheme.canonical[triangles].mean(axis=1) @ rotation.as_matrix()[2]
    between = spans_a_gap(triangles, face.scheme)
    shown = np.flatnonzero(facing(corners) | between)
    order = shown[np.argsort((nearness - BEHIND_CM * between)[shown])]
    values = np.column_stack([face.landmarks, np.ones(len(face.landmarks))]).astype(np.float64)
    return draw_triangles(corners[order], values[triangles[order]], still.image.shape[:2])


def spans_a_gap(triangles: NDArray[np.int32], scheme: LandmarkScheme) -> NDArray[np.bool_]:
    """Which triangles (count, 3) span lids or lips: (count,)."""
    inner_lips = (*scheme.upper_lip_inner, *scheme.lower_lip_inner)
    gaps = (inner_lips, scheme.right_eye.lids, scheme.left_eye.lids)
    return np.asarray(np.any([np.isin(triangles, gap).all(axis=1) for gap in gaps], axis=0))


def _around(canonical: NDArray[np.float64], feature: tuple[int, ...], rim: tuple[float, float]) -> NDArray[np.float64]:
    distance = _nearest(canonical, canonical[list(feature)])
    return np.asarray(smoothstep(distance, rim[1], rim[0]))


def _nearest(points: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance (count,) of each of `points` from the nearest of `others`."""
    return np.asarray(np.linalg.norm(points[:, None] - others, axis=2).min(axis=1))
