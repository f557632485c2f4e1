"""A generic head fitted to one picture: nothing of a person's shape is known but landmarks and the matte.

The landmarks carry the canonical face. Behind it lies a skull, an ellipsoid in the axes of the head; below it a neck, a
cylinder; what else the matte has, hair and clothes, is a body inflated from its outline. These surfaces meet with
steps, and a step in depth throws a shadow that nobody has, such as a band across the forehead. So only their slopes are
taken, each the less the nearer its end is, and one surface is found whose slopes are nearest to all of them. It may
break in one place, where it does: from the jaw to the neck.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.errors import CaptureError
from relit_camera.base.images.image_types import Mask, Points
from relit_camera.capture.geometry.horizon_map import HorizonMap, compute_horizon_map
from relit_camera.capture.geometry.normal_completion import complete_normals
from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.instant.surface_raster import raster_mesh, vertex_normals
from relit_camera.face.head_pose import HeadPose, fit_pose, unproject
from relit_camera.face.landmarks.canonical_face import canonical_face
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class HeadTunables:
    """Sizes of a mean head, in centimeters and head axes, and how its parts are joined.

    The skull is as large as an adult's (16 cm broad with some hair, 19.5 long) and placed so that it goes on where the
    canonical forehead ends (`face.landmarks.canonical_face`). How parts are joined was chosen by looking at pictures
    of people under lamps from all sides.

    Attributes:
        skull_center, skull_radii: of the ellipsoid.
        neck_center, neck_radii: x and z of the neck's axis, and its radii.
        neck_top, neck_end: y from which the neck goes down, and where the chest has taken over.
        jaw_band: y below which the face's outline is a step to what lies behind it.
        join: width of the band on both sides of a part's end in which it counts less.
        smooth: standard deviation of the blur of all normals.
        skull_weight, neck_weight: of these normals where the face's have 1.
        chest_slope, chest_roundness: y of a chest's normal over its z, and what its x over z grows by each centimeter.
        chest_weight, chest_depth: its weight, and the distance from the outline from which it has that weight.
        anchor_weight: of the neck's depth where a slope has 1: behind the jaw the surface is not connected.
        face_rim: confidence of the face's normals at its outline: there the mesh is a guess.
        steepest: largest slope that is integrated.
        penumbra: standard deviation of the blur of the horizons: as much as they are wrong, so that no edge of a shadow
            lies where it is not.
        skin_margin: how far from eyes, brows, lips and the outline skin counts as skin.
        certainty_blur: standard deviation of the blur of what is certain.
    """

    skull_center: tuple[float, float, float] = (0.0, 3.5, -4.2)
    skull_radii: tuple[float, float, float] = (8.0, 10.4, 9.7)
    neck_center: tuple[float, float] = (0.0, -5.5)
    neck_radii: tuple[float, float] = (5.8, 5.5)
    neck_top: float = -4.0
    neck_end: float = -14.0
    jaw_band: float = -4.0
    join: float = 1.5
    smooth: float = 0.25
    skull_weight: float = 0.5
    neck_weight: float = 0.5
    chest_slope: float = 0.25
    chest_roundness: float = 0.03
    chest_weight: float = 0.15
    chest_depth: float = 5.0
    anchor_weight: float = 0.02
    face_rim: float = 0.15
    steepest: float = 3.0
    penumbra: float = 0.25
    skin_margin: float = 0.35
    certainty_blur: float = 0.7


HEAD = HeadTunables()
FOCAL_LENGTHS = 2.0
"""Focal length that a crop of the head is taken to have, in its longer sides."""


@dataclass(frozen=True)
class HeadShape:
    """A generic head as one picture shows it.

    Attributes:
        geometry: normals, depth in pixels and horizons; the albedo is white, the confidence that of a guess.
        face: (height, width) where the face's own mesh lies.
        skin: (height, width) where the face is skin: no eye, brow, lip, nor its outline.
        certainty: (height, width) float32, 1 on the face and the neck, falling to 0 on hair and clothes, of whose shape
            only the outline is known.
        pixels_per_cm: scale of the head in the picture.
        pose: of the head before the camera.
    """

    geometry: Geometry
    face: Bools
    skin: Bools
    certainty: Mask
    pixels_per_cm: float
    pose: HeadPose


def fit_head_shape(landmarks: Points, matte: Mask, scheme: LandmarkScheme | None = None) -> HeadShape:
    """Fit the generic head.

    Args:
        landmarks: (478, 2) of the scheme `mesh478`, pixels of the picture.
        matte: (height, width) of the person, in a picture that is cropped about the head.
        scheme: of the landmarks; `mesh478` where None.

    Raises:
        CaptureError: no head before a camera has these landmarks, or the matte does not show a person there.
    """
    scheme = scheme or landmark_scheme("mesh478")
    height, width = matte.shape
    body = matte > 0.5
    pose = fit_pose(landmarks, scheme, (width, height), FOCAL_LENGTHS * max(width, height))
    if pose is None:
        raise CaptureError("no head pose fits the landmarks of the face", "look straight into the camera")
    posed = _PosedHead(landmarks, scheme, pose, (height, width))
    face_depth, face_normals = posed.face()
    face = np.isfinite(face_depth) & body
    if face.sum() < 0.5 * np.isfinite(face_depth).sum() or not face.any():
        raise CaptureError(
            "the matte does not show a person where the face is", "choose a background that parts better"
        )
    unit = posed.pixels_per_cm
    normals, confidence = _joined_normals(posed, face, face_normals, body)
    normals = complete_normals(_blurred_normals(normals, confidence, HEAD.smooth * unit), confidence, matte)
    neck_depth, neck = posed.neck(body & ~face)
    depth = _integrated(normals, body, face, face_depth, np.where(neck, neck_depth, np.nan), posed)
    horizon = _soft(compute_horizon_map(depth), HEAD.penumbra * unit)
    white = np.where(body[..., None], np.float32(1), np.float32(0)).repeat(3, axis=2)
    sure = cv2.GaussianBlur((face | neck).astype(np.float32), (0, 0), HEAD.certainty_blur * unit)
    skin = posed.skin(face)
    return HeadShape(Geometry(normals, white, confidence, depth, horizon), face, skin, sure, unit, pose)


class _PosedHead:
    """The parts of the head in the picture's axes: x and y in pixels, y down; z in pixels toward the camera."""

    def __init__(self, landmarks: Points, scheme: LandmarkScheme, pose: HeadPose, size: tuple[int, int]) -> None:
        self.size, self._landmarks, self._scheme = size, landmarks, scheme
        self._turn = pose.rotation.as_matrix()
        self.pixels_per_cm = float(pose.focal_px / -pose.translation[2])
        height, width = size
        points = unproject(landmarks, pose, scheme, (width, height))[: len(canonical_face().vertices)]
        self._toward = points @ self._turn.T
        # In parallel projection, about the middle of the face, where the scale is that of the pose.
        self._origin = landmarks[: len(points)].mean(axis=0) - self._toward.mean(axis=0)[:2] * self._pixel_axes
        self._columns, self._rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)

    @property
    def _pixel_axes(self) -> Float64Array:
        return np.array([self.pixels_per_cm, -self.pixels_per_cm])

    def face(self) -> tuple[Float32Array, Float32Array]:
        """Depth (height, width), NaN beyond it, and normals (height, width, 3) of the face's mesh."""
        triangles = canonical_face().triangles
        normals = vertex_normals(self._toward, triangles)
        pixels = np.column_stack([self._landmarks[: len(normals)], self._toward[:, 2] * self.pixels_per_cm])
        front = normals[triangles].mean(axis=1)[:, 2] > 0
        return raster_mesh(pixels.astype(np.float64), triangles[front], normals, self.size)

    def skull(self) -> tuple[Float64Array, Float64Array]:
        """Depth (height, width), NaN beyond it, and normals (height, width, 3) of the skull's front."""
        center = self._turn @ np.array(HEAD.skull_center)
        shape = self._turn @ np.diag(1 / np.array(HEAD.skull_radii) ** 2) @ self._turn.T
        return self._quadric(center, shape)

    def neck(self, behind: Bools) -> tuple[Float64Array, Bools]:
        """Depth (height, width) of the neck, and where it is seen: in pixels `behind` the face and below the ears."""
        center = self._turn @ np.array([HEAD.neck_center[0], HEAD.neck_top, HEAD.neck_center[1]])
        across, deep = HEAD.neck_radii
        depth, _ = self._quadric(center, np.diag([1 / across**2, 0, 1 / deep**2]))
        below = (self._rows > self._pixel(center)[1]) & (self.neck_fraction() > 0)
        return depth, np.isfinite(depth) & below & behind

    def neck_fraction(self) -> Float64Array:
        """How far rows (height, width) are the neck's, 1 at its top and 0 from its end."""
        top, end = (self._pixel(np.array([0, y, 0.0]))[1] for y in (HEAD.neck_top, HEAD.neck_end))
        return np.asarray(np.clip(2 * (end - self._rows) / (end - top), 0, 1))

    def chest_normals(self) -> Float64Array:
        """Normals (height, width, 3) of a chest."""
        middle = self._pixel(np.array([0, HEAD.neck_top, 0.0]))[0]
        across = HEAD.chest_roundness * (self._columns - middle) / self.pixels_per_cm
        normals = np.stack([across, np.full(self.size, HEAD.chest_slope), np.ones(self.size)], axis=-1)
        return np.asarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True))

    def below_chin(self) -> Bools:
        """Where rows (height, width) lie below the middle of the jaw: chest, shoulders, long hair before them."""
        return np.asarray(self._rows > self.jaw_row())

    def neck_normals(self) -> Float64Array:
        """Normals (height, width, 3) of the neck; NaN beyond it."""
        center = self._turn @ np.array([HEAD.neck_center[0], HEAD.neck_top, HEAD.neck_center[1]])
        across, deep = HEAD.neck_radii
        return self._quadric(center, np.diag([1 / across**2, 0, 1 / deep**2]))[1]

    def _pixel(self, point: Float64Array) -> Float64Array:
        return np.asarray(self._origin + point[:2] * self._pixel_axes)

    def _quadric(self, center: Float64Array, shape: Float64Array) -> tuple[Float64Array, Float64Array]:
        """The front of {x : (x − c)ᵀ S (x − c) = 1}, in centimeters turned as the head is: depth in pixels, normals."""
        middle = self._pixel(center)
        x, y = (self._columns - middle[0]) / self.pixels_per_cm, (middle[1] - self._rows) / self.pixels_per_cm
        linear = shape[0, 2] * x + shape[1, 2] * y
        rest = shape[0, 0] * x * x + 2 * shape[0, 1] * x * y + shape[1, 1] * y * y - 1
        under_root = linear**2 - shape[2, 2] * rest
        z = (-linear + np.sqrt(np.where(under_root > 0, under_root, np.nan))) / shape[2, 2]
        normals = np.stack([x, y, z], axis=-1) @ shape
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        return (center[2] + z) * self.pixels_per_cm, normals

    def skin(self, face: Bools) -> Bools:
        """Where the face is skin, see `HeadShape`."""
        scheme = self._scheme
        parts = (
            *((*eye.lids, *eye.iris) for eye in (scheme.right_eye, scheme.left_eye)),
            scheme.lips,
            scheme.right_brow,
            scheme.left_brow,
        )
        bare = np.zeros(self.size, np.uint8)
        bare[face] = 1
        for part in parts:
            hull = cv2.convexHull(self._landmarks[list(part)].astype(np.float32))
            cv2.fillConvexPoly(bare, np.floor(hull).astype(np.int32), 0)
        margin = max(round(HEAD.skin_margin * self.pixels_per_cm), 1)
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * margin + 1, 2 * margin + 1))
        return np.asarray(cv2.erode(bare, kernel, borderValue=0) > 0)

    def jaw_row(self) -> float:
        """The row of the picture below which the face's outline is a step."""
        low = self._toward[:, 1] < HEAD.jaw_band
        return float(self._landmarks[: len(low)][low, 1].min())


def _inside_distance(mask: Bools) -> Float32Array:
    """Distance in pixels of each pixel of a mask to the nearest one outside; 0 outside. The border is no end."""
    padded = cv2.copyMakeBorder(mask.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.distanceTransform(padded, cv2.DIST_L2, 5)[1:-1, 1:-1], np.float32)


def _joined_normals(
    posed: _PosedHead, face: Bools, face_normals: Float32Array, body: Bools
) -> tuple[Float32Array, Float32Array]:
    """Normals (height, width, 3) of all parts, each weighed less near its end, and their confidence (height, width)."""
    band = HEAD.join * posed.pixels_per_cm
    _, skull_normals = posed.skull()
    on_skull = np.isfinite(skull_normals[..., 2]) & body
    _, on_neck = posed.neck(body & ~face)
    outside = np.clip(_inside_distance(~face) / band, 0, 1)
    face_weight = np.where(face, HEAD.face_rim + (1 - HEAD.face_rim) * np.clip(_inside_distance(face) / band, 0, 1), 0)
    # An ellipsoid's rim is a guess where hair stands off, and tells nothing that the outline does not tell.
    facing = np.clip(np.nan_to_num(skull_normals[..., 2]) / 0.5, 0, 1)
    skull_weight = np.where(on_skull & ~on_neck, HEAD.skull_weight * facing * np.maximum(outside, HEAD.face_rim), 0)
    skull_weight = np.where(face, HEAD.skull_weight * facing * (1 - face_weight) * on_skull, skull_weight)
    neck_fraction = posed.neck_fraction()
    neck_weight = np.where(on_neck, HEAD.neck_weight * outside * neck_fraction, 0)
    deep = np.clip(_inside_distance(body) / (HEAD.chest_depth * posed.pixels_per_cm), 0, 1)
    chest_weight = np.where(face | ~body, 0, HEAD.chest_weight * deep * (1 - neck_fraction) * posed.below_chin())
    parts = (
        (face_normals, face_weight),
        (np.nan_to_num(skull_normals), skull_weight),
        (np.nan_to_num(posed.neck_normals()), neck_weight),
        (posed.chest_normals(), chest_weight),
    )
    total = sum(weight for _, weight in parts)
    normals = sum(part * weight[..., None] for part, weight in parts)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(length > 1e-9, normals / np.maximum(length, 1e-9), (0, 0, 1))
    return normals.astype(np.float32), np.where(body, np.minimum(total, 1), 0).astype(np.float32)


def _blurred_normals(normals: Float32Array, confidence: Float32Array, sigma: float) -> Float32Array:
    """Unit normals, blurred by their confidence."""
    summed = cv2.GaussianBlur(normals * confidence[..., None], (0, 0), sigma)
    length = np.linalg.norm(summed, axis=-1, keepdims=True)
    return np.asarray(np.where(length > 1e-6, summed / np.maximum(length, 1e-6), normals), np.float32)


def _integrated(
    normals: Float32Array,
    body: Bools,
    face: Bools,
    face_depth: Float32Array,
    neck_depth: Float64Array,
    posed: _PosedHead,
) -> Float32Array:
    """Depth (height, width) in pixels whose slopes are those of the normals, NaN outside the body, mean 0.

    Weighted least squares. Below the jaw no slope connects the face with what is behind it; there the neck's depth,
    relative to the face's, holds the other side.
    """
    number = np.full(body.shape, -1)
    number[body] = np.arange(body.sum())
    facing = np.maximum(normals[..., 2], 1e-3)
    right = np.clip(-normals[..., 0] / facing, -HEAD.steepest, HEAD.steepest)
    down = np.clip(normals[..., 1] / facing, -HEAD.steepest, HEAD.steepest)
    low = np.arange(body.shape[0]) >= posed.jaw_row()
    rows, columns, values, steps, weights = [], [], [], [], []
    count = 0
    for slope, (there, here) in ((right, (np.s_[:, 1:], np.s_[:, :-1])), (down, (np.s_[1:], np.s_[:-1]))):
        both = body[there] & body[here]
        broken = (face[there] != face[here]) & low[: both.shape[0], None]
        first, second = number[here][both], number[there][both]
        equations = count + np.arange(len(first))
        rows += [equations, equations]
        columns += [second, first]
        values += [np.ones(len(first)), -np.ones(len(first))]
        steps.append(((slope[there] + slope[here]) / 2)[both])
        weights.append(np.where(broken[both], 0.0, 1.0))
        count += len(first)
    for depth, weight in ((np.where(face, face_depth, np.nan), 0.1), (neck_depth, HEAD.anchor_weight)):
        known = number[np.isfinite(depth) & body]
        equations = count + np.arange(len(known))
        rows.append(equations)
        columns.append(known)
        values.append(np.ones(len(known)))
        steps.append(depth[np.isfinite(depth) & body])
        weights.append(np.full(len(known), weight))
        count += len(known)
    system = csr_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=(count, int(body.sum()))
    )
    weighted = system.T @ diags_array(np.concatenate(weights))
    matrix = csc_array(weighted @ system + diags_array(np.full(int(body.sum()), 1e-7)))
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solved = factors.solve(weighted @ np.concatenate(steps))
    result = np.full(body.shape, np.nan, np.float32)
    result[body] = solved - solved.mean()
    return result


def _soft(horizon: HorizonMap, sigma: float) -> HorizonMap:
    """The horizons, blurred over the picture."""
    planes = np.moveaxis(horizon.heights.astype(np.float32), 2, 0)
    return HorizonMap(np.dstack([cv2.GaussianBlur(plane, (0, 0), sigma) for plane in planes]).astype(np.float16))
