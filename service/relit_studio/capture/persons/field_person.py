"""A person with a known reflectance field in front of the phone: relit by interpolation, moved by their depth map.

The field is a folder of one-light pictures (`lights.lp`, `matte.png`), with `truth.npz` (depth) and `field.json`
(the camera) beside them, as `python -m relit_studio field` writes it. Every pixel is lit from its own direction and
distance: the direction is interpolated between the field's lights, and the torch's inverse square falls at the point
that the depth gives. A moved head is the same surface, projected from where it went; what it would uncover stays
hidden. The field moves as one: the shoulders go with the head.
"""

from __future__ import annotations

import json
from pathlib import Path
from zipfile import BadZipFile

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from relit_camera.base.errors import LightsError
from relit_camera.base.images.color import Gamma
from relit_camera.base.images.image_types import LinearImage
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.reflectance.delaunay_triangulation import spherical_barycentric, spherical_delaunay
from relit_camera.capture.reflectance.methods.barycentric_methods import SphericalBarycentric
from relit_camera.light.directions import texel_directions, texel_solid_angles
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.capture.flash.torch import Torch
from relit_studio.capture.persons.captured_person import FACE_REACH_CM, Layers
from relit_studio.capture.persons.head_motion import Motion

CAMERA_NAME, TRUTH_NAME = "field.json", "truth.npz"

_NOSE_CM = np.array([0.0, -0.6, 7.5])
"""From the head's origin to the tip of the nose."""
_NEAR_COSINE = 0.5
"""Cosine of the largest angle to the torch's direction at which lights are used for interpolation."""
_STEPS = 4
"""Fixed-point iterations that invert the movement in the picture."""


class FieldPerson:
    """See `person.Person`; the picture has the field's shape at another size."""

    def __init__(self, folder: Path, height: int, room: LightMap, gamma: Gamma = "srgb") -> None:
        """Read a field and seat the person in a room of this light.

        Args:
            folder: of the field.
            height: of the pictures to make, pixels.
            room: light map.
            gamma: curve of the field's 8- and 16-bit pictures.

        Raises:
            LightsError: the pictures, their directions, the depth or the camera are missing or do not fit.
            ImageError: a picture cannot be read.
        """
        self.name = folder.name
        samples = import_samples(folder / "lights.lp", gamma)
        self._pictures, self._matte = samples.pictures, samples.matte
        self._directions = samples.directions
        field_camera, depth_zero_cm, self.credits = _read_description(folder / CAMERA_NAME, self._matte.shape)
        depth = _read_depth(folder / TRUTH_NAME, self._matte.shape)
        scale = height / field_camera.height
        self.camera = Pinhole(round(field_camera.width * scale), height, field_camera.focal_px * scale)
        self._field_camera = field_camera
        self._inside = self._matte > 0.5
        # Depth at the person's edge may be mixed with empty background.
        nearest = distance_transform_edt(~self._inside, return_distances=False, return_indices=True)
        self._points = _unproject(field_camera, depth[tuple(nearest)] - depth_zero_cm)
        self._origin = _head_origin(self._points[self._inside])
        self._triangles = spherical_delaunay(self._directions)
        self._room = room
        texels = texel_directions().reshape(-1, 3)
        self._light_of_texel = SphericalBarycentric().weights(self._directions, texels)

    @property
    def origin(self) -> NDArray[np.float64]:
        """See `Person.origin`."""
        return self._origin

    def layers(self, motion: Motion, torch: Torch | None) -> Layers:
        """See `Person.layers`."""
        at = self._sources(motion)
        ambient = self._moved(self._ambient(motion), at)
        flash = np.zeros_like(ambient) if torch is None else self._moved(self._flash(motion, torch), at)
        return Layers(self._moved(self._matte, at), ambient, flash)

    def face_points(self) -> NDArray[np.float64]:
        """See `Person.face_points`."""
        points = self._points[self._inside]
        return np.asarray(points[np.linalg.norm(points - self._origin, axis=1) < FACE_REACH_CM])

    def _ambient(self, motion: Motion) -> LinearImage:
        """The field under the room's light, rotated into the head's axes."""
        light = rotate_light_map(self._room, motion.rotation) * texel_solid_angles()[..., None]
        power = self._light_of_texel @ light.reshape(-1, 3).astype(np.float32)
        return np.asarray(np.einsum("lhwc,lc->hwc", self._pictures, power, optimize=True))

    def _flash(self, motion: Motion, torch: Torch) -> LinearImage:
        """The field under the torch, whose direction differs from pixel to pixel, in the head's axes."""
        rows, columns = np.nonzero(self._matte)
        points = self._points[rows, columns] - self._origin
        moved_torch = Torch(
            motion.undo(torch.position - self._origin), np.asarray(motion.rotation.inv().apply(torch.aim))
        )
        way = moved_torch.position - points
        toward = way / np.linalg.norm(way, axis=1, keepdims=True)
        corners, weights = self._interpolation(toward)
        lit = np.zeros((len(rows), 3), np.float32)
        for corner, weight in zip(corners.T, weights.T.astype(np.float32), strict=True):
            lit += weight[:, None] * self._pictures[corner, rows, columns]
        picture = np.zeros((*self._matte.shape, 3), np.float32)
        picture[rows, columns] = lit * moved_torch.irradiance(points)[:, None]
        return picture

    def _interpolation(self, toward: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Lights (count, 3) about directions (count, 3), and their weights; outside the field's hull the nearest."""
        near = self._directions[self._triangles] @ toward.mean(axis=0) > _NEAR_COSINE
        triangles = self._triangles[near.any(axis=1)] if near.any() else self._triangles
        corners = self._directions[triangles]
        edges = np.cross(corners, np.roll(corners, -1, axis=1))
        edges /= np.linalg.norm(edges, axis=2, keepdims=True)
        depth = np.full(len(toward), -np.inf)
        chosen = np.zeros(len(toward), np.intp)
        for index, sides in enumerate(edges):
            inside = (toward @ sides.T).min(axis=1)
            better = inside > depth
            depth[better], chosen[better] = inside[better], index
        vertices = triangles[chosen]
        return vertices, spherical_barycentric(toward, self._directions[vertices])

    def _sources(self, motion: Motion) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """For every pixel of the new picture, x and y (height, width) in the field's pictures, OpenCV's convention."""
        field = self._field_camera
        moved = motion.apply(self._points - self._origin) + self._origin
        x, y, _ = np.moveaxis(field.project(moved.reshape(-1, 3)).reshape(*self._matte.shape, 3), -1, 0)
        rest_x, rest_y = field.pixel_grid()
        # The movement is smooth except at depth steps, where the background near the edge moves along.
        shift = np.stack([x - rest_x, y - rest_y], axis=-1).astype(np.float32)
        shift = _filled(shift, self._inside)
        wanted = np.stack(self.camera.pixel_grid(), axis=-1) * (field.height / self.camera.height)
        source = wanted.astype(np.float32)
        for _ in range(_STEPS):
            there = cv2.remap(
                shift, source[..., 0] - 0.5, source[..., 1] - 0.5, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
            source = (wanted - there).astype(np.float32)
        return source[..., 0] - 0.5, source[..., 1] - 0.5

    def _moved(self, picture: NDArray[np.float32], at: tuple[NDArray[np.float32], NDArray[np.float32]]) -> NDArray:
        # Extend the lower border below the picture, where the body continues.
        return np.asarray(cv2.remap(picture, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def _filled(shift: NDArray[np.float32], inside: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The person's movement (h, w, 2), carried on smoothly outside of them."""
    weight = inside.astype(np.float32)
    sigma = max(2.0, inside.shape[0] / 40)
    known = cv2.GaussianBlur(shift * weight[..., None], (0, 0), sigma)
    fraction = cv2.GaussianBlur(weight, (0, 0), sigma)[..., None]
    mean = shift[inside].mean(axis=0)
    outside = np.where(fraction > 1e-3, known / np.maximum(fraction, 1e-3), mean)
    return np.where(inside[..., None], shift, outside).astype(np.float32)


def _unproject(camera: Pinhole, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (height, width, 3) in camera axes of pixels whose z (height, width) is known."""
    rays = camera.rays(*camera.pixel_grid())
    return np.asarray(rays * (z / rays[..., 2])[..., None])


def _head_origin(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The head's origin (3,): behind what is nearest to the camera in the upper part, the tip of the nose."""
    low, high = points[:, 1].min(), points[:, 1].max()
    upper = points[points[:, 1] > low + 0.4 * (high - low)]
    nose = upper[upper[:, 2] >= np.percentile(upper[:, 2], 99.8)].mean(axis=0)
    return np.asarray(nose - _NOSE_CM)


def _read_description(path: Path, shape: tuple[int, ...]) -> tuple[Pinhole, float, tuple[str, ...]]:
    """The field's camera, how far before it the depth is 0, centimeters, and whom to credit."""
    cure = "make the field again with `python -m relit_studio field`"
    try:
        described = json.loads(path.read_text())
        told, named = described["camera"], tuple(map(str, described.get("credits", ())))
        camera = Pinhole(shape[1], shape[0], float(told["focal_px"]))
        depth_zero_cm = float(told["depth_zero_cm"])
    except OSError as error:
        raise LightsError(f"cannot read {path}: {error.strerror}", cure) from error
    except (ValueError, KeyError, TypeError) as error:
        raise LightsError(f"{path} does not describe the field's camera: {error!r}", cure) from error
    if not (camera.focal_px > 0 and depth_zero_cm > 0):
        raise LightsError(f"{path} has a camera of focal_px {camera.focal_px}, depth_zero_cm {depth_zero_cm}", cure)
    return camera, depth_zero_cm, named


def _read_depth(path: Path, shape: tuple[int, ...]) -> NDArray[np.float64]:
    cure = "a capture needs the field's depth; make the field again with `python -m relit_studio field`"
    try:
        with path.open("rb") as file, np.load(file) as kept:
            depth = np.asarray(kept["depth"], np.float64)
    except OSError as error:
        raise LightsError(f"cannot read {path}: {error.strerror or error}", cure) from error
    except (ValueError, KeyError, EOFError, BadZipFile) as error:
        raise LightsError(f"{path} holds no depth: {error}", cure) from error
    if depth.shape != shape or not np.isfinite(depth).all():
        raise LightsError(f"the depth in {path} has shape {depth.shape}, the pictures {shape}, or is not finite", cure)
    return depth
