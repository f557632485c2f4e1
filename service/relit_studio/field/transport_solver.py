"""Light transport solver: computes a small reflectance field of the mannequin, or of any mesh, without Cycles.

Per pixel sample: Lambert and GGX under each light with a shadow map; at the mesh's vertices: diffuse light between
surfaces (`solver_transport`), bounce by bounce, interpolated to the samples. No light below the skin.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from relit_camera.base.images.image_files import write_display, write_linear
from relit_camera.base.images.image_types import LinearImage, Mask
from relit_camera.base.storage.atomic_files import atomic_path, write_atomic
from relit_camera.light.directions import texel_directions
from relit_studio.base.progress import Progress, no_progress
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.pinhole import Pinhole
from relit_studio.field.solver_gloss import gloss_albedo, glossy
from relit_studio.field.solver_scene import Surfaces, mannequin_surfaces
from relit_studio.field.solver_transport import Transport, bounce_light, transport
from relit_studio.mannequin.outputs.olat import gray, light_names, lights_text
from relit_studio.mannequin.rendering.rasterizer import Hits, rasterize
from relit_studio.mannequin.rendering.shading import ShadowMap
from relit_studio.mannequin.shape.figure import Posture, mannequin

Values = NDArray[np.float32]

DISTANCE_CM, HEIGHT_CM, BELOW_AXIS_CM = 62.0, 38.0, 1.0
"""The camera before the mannequin: distance of the head's origin, what the picture's height spans there, and how far
the origin lies below the axis."""
_NEIGHBORS = 4
"""Number of vertices that a sample's indirect light is interpolated from."""


@dataclass(frozen=True)
class SolverSettings:
    """Resolution of the solver.

    Attributes:
        width, height: of the pictures, pixels.
        map_rows: rows of the light map, with twice as many columns, at whose texels the lights are.
        bounces: diffuse reflections that light takes before the last one.
        bundles: directions of the ray bundles between surfaces.
        rays: along a side of each bundle.
        supersampling: samples a pixel along each side.
        shadow: texels along a side of a light's shadow map.
    """

    width: int = 64
    height: int = 48
    map_rows: int = 8
    bounces: int = 3
    bundles: int = 160
    rays: int = 144
    supersampling: int = 3
    shadow: int = 512


@dataclass(frozen=True, eq=False)
class SolvedField:
    """One-light pictures over black, with matte, normals, albedo and depth.

    Attributes:
        pictures: (lights, height, width, 3) float32 under distant lights of unit irradiance.
        matte: (height, width).
        normals: (height, width, 3) unit vectors, zero where there is nothing.
        albedo: (height, width, 3) linear.
        depth: (height, width) z in camera axes, centimeters, zero where there is nothing.
    """

    pictures: NDArray[np.float32]
    matte: Mask
    normals: NDArray[np.float32]
    albedo: LinearImage
    depth: NDArray[np.float32]


def solve(
    surfaces: Surfaces,
    camera: Pinhole,
    directions: NDArray[np.float64],
    settings: SolverSettings,
    progress: Progress = no_progress,
) -> SolvedField:
    """Solve the field of `surfaces` under distant lights from `directions`, unit vectors (lights, 3)."""
    fine = camera.scaled(settings.supersampling)
    projected = fine.project(surfaces.vertices).astype(np.float32)
    hits = rasterize(projected, surfaces.triangles, fine.width, fine.height)
    positions, normals = hits.interpolate(surfaces.vertices), _unit(hits.interpolate(surfaces.normals))
    albedo = hits.interpolate(surfaces.albedo)
    finish = hits.interpolate(np.stack([surfaces.f0, surfaces.alpha], axis=1))
    views = _unit(-positions)

    def averaged(values: Values) -> NDArray[np.float32]:
        return _picture(camera, settings.supersampling, hits, values)

    used = np.unique(surfaces.casters)
    nodes, node_normals = surfaces.vertices[used], surfaces.normals[used]
    direct = np.empty((len(used), len(directions)), np.float32)
    pictures = np.empty((len(directions), camera.height, camera.width, 3), np.float32)
    for index, direction in enumerate(directions):
        shadow = ShadowMap(surfaces.vertices, surfaces.triangles, direction, settings.shadow)
        direct[:, index] = shadow.lit(nodes, node_normals) * np.maximum(node_normals @ direction, 0)
        gloss, cosine = glossy(normals, views, direction, finish[:, 0], finish[:, 1])
        sent = albedo * cosine[:, None] + gloss[:, None]
        pictures[index] = averaged(sent * shadow.lit(positions, normals)[:, None])
        progress(index + 1, len(directions))

    between = transport(nodes, np.searchsorted(used, surfaces.casters), settings.bundles, settings.rays)
    received = bounce_light(direct, surfaces.albedo[used], between, settings.bounces)
    to_samples = _interpolation(positions, normals, nodes, node_normals, between)
    facing = np.maximum(np.einsum("ij,ij->i", normals, views), 0)
    base = (1 - gloss_albedo(finish[:, 0], finish[:, 1], facing))[:, None] * albedo
    for index, picture in enumerate(pictures):
        picture += averaged(base * (to_samples @ received[:, index]))

    matte = averaged(np.ones((len(positions), 1), np.float32))
    return SolvedField(
        pictures=pictures,
        matte=matte,
        normals=_unit(averaged(normals).reshape(-1, 3)).reshape(camera.height, camera.width, 3),
        albedo=averaged(albedo),
        depth=np.asarray(averaged(positions[:, 2:]) / np.maximum(matte, 1e-6), np.float32),
    )


def solver_camera(settings: SolverSettings) -> Pinhole:
    """The camera before the mannequin."""
    return Pinhole(settings.width, settings.height, settings.height * DISTANCE_CM / HEIGHT_CM)


def write_solver_field(folder: Path, settings: SolverSettings | None = None, progress: Progress = no_progress) -> None:
    """Solve the neutral mannequin's field and write it, as `relit capture import` reads it.

    `000.exr` … are linear, over black, not clipped; lights stand at the texels of the map, row by row from the top.
    Beside them `lights.lp`, `matte.png`, `landmarks.json`, `truth.npz` (normals, linear albedo, depth in centimeters
    toward the camera from the head's origin) and `field.json` (settings, camera).

    Args:
        folder: made if missing.
        settings: the reduced field of 64 x 48 pixels under 16 x 8 lights unless given.
        progress: told of every picture.

    Raises:
        InputError: the folder holds a field of other settings.
        StorageError: a file cannot be written.
    """
    settings = settings or SolverSettings()
    camera = solver_camera(settings)
    seen_by = {"focal_px": camera.focal_px, "depth_zero_cm": DISTANCE_CM}
    described = {"person": "mannequin", "settings": asdict(settings), "camera": seen_by}
    keep_settings(folder, "field.json", described)
    place = np.array([0.0, -BELOW_AXIS_CM, -DISTANCE_CM])
    directions = texel_directions(settings.map_rows, 2 * settings.map_rows).reshape(-1, 3)
    solved = solve(mannequin_surfaces(place), camera, directions, settings, progress)
    names = light_names(len(directions))
    for name, picture in zip(names, solved.pictures, strict=True):
        write_linear(folder / name, picture)
    write_display(folder / "matte.png", gray(solved.matte))
    points = camera.project(mannequin().landmarks(Posture()) + place)[:, :2].round(3).tolist()
    write_atomic(folder / "landmarks.json", json.dumps({"mesh478": points}))
    depth = np.where(solved.matte > 0, solved.depth + DISTANCE_CM, 0).astype(np.float32)
    with atomic_path(folder / "truth.npz") as temporary:
        np.savez_compressed(temporary, normals=solved.normals, albedo=solved.albedo, depth=depth)
    write_atomic(folder / "lights.lp", lights_text(names, directions))


def _interpolation(
    positions: Values, normals: Values, nodes: Values, node_normals: Values, between: Transport
) -> sparse.csr_array:
    """Weights (samples, nodes) of the nearest nodes that face the same way and were met by rays."""
    met = np.flatnonzero(between.sky + between.form_factors.sum(axis=1) > 0)
    distance, near = cKDTree(nodes[met]).query(positions, k=np.arange(1, min(_NEIGHBORS, len(met)) + 1))
    near = met[near]
    aligned = np.maximum(np.einsum("ij,ikj->ik", normals, node_normals[near]), 0) ** 2 + 1e-6
    weights = aligned / (distance + 1e-3)
    weights /= weights.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(positions)), near.shape[1])
    shape = (len(positions), len(nodes))
    return sparse.csr_array((weights.ravel().astype(np.float32), (rows, near.ravel())), shape=shape)


def _picture(camera: Pinhole, fine: int, hits: Hits, values: Values) -> NDArray[np.float32]:
    """Values (samples, k) averaged to pixels (height, width, k), or (height, width) of one channel."""
    samples = np.zeros((camera.height * camera.width * fine * fine, values.shape[1]), np.float32)
    samples[hits.pixels] = values
    shaped = samples.reshape(camera.height * fine, camera.width * fine, -1)
    return np.asarray(cv2.resize(shaped, (camera.width, camera.height), interpolation=cv2.INTER_AREA), np.float32)


def _unit(vectors: Values) -> Values:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-6))
