"""Render jobs for the worker as files: a JSON job, and its arrays in an .npz file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.storage.atomic_files import atomic_path, make_folder, write_atomic
from relit_studio.cameras.studio_camera import Camera

JOB_FILE = "job.json"

Material = Mapping[str, Any]
"""A material: its `kind` (see `worker/materials.py`) and that kind's arguments; picture files as absolute paths."""

Shape = Mapping[str, NDArray]
"""Changed geometry by "object.vertices", "object.points" or, for a rigid motion in room axes, "object.matrix"."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface.

    Attributes:
        name: unique in the scene.
        vertices: (count, 3) in our axes, centimeters.
        faces: (faces, 4) int, counter-clockwise from outside, -1 in the last column of a triangle.
        slots: (faces,) int, which of `materials` each face has.
        materials: names in the scene.
        uv: (count, 2) texture coordinates, v up, or None.
        attributes: (count,) each, by the name under which materials know it.
        subdivision: how often Cycles subdivides it.
    """

    name: str
    vertices: NDArray
    faces: NDArray
    slots: NDArray
    materials: tuple[str, ...]
    uv: NDArray | None = None
    attributes: Mapping[str, NDArray] = field(default_factory=dict)
    subdivision: int = 0


@dataclass(frozen=True, eq=False)
class Strands:
    """Hairs.

    Attributes:
        name: unique in the scene.
        points: (strands, points, 3) in our axes, centimeters.
        radius: (strands, points) centimeters.
        shade: (strands,) added, scaled, to the material's melanin; about -1 to 1.
        material: name in the scene.
    """

    name: str
    points: NDArray
    radius: NDArray
    shade: NDArray
    material: str


@dataclass(frozen=True, eq=False)
class Scene:
    """All objects and materials to render."""

    objects: tuple[Mesh | Strands, ...]
    materials: Mapping[str, Material]


@dataclass(frozen=True)
class Quality:
    """Render quality of Cycles.

    Attributes:
        samples: a pixel.
        denoise: with OpenImageDenoise. It moves means by less than 0.0003 and softens hair.
        clamp_indirect: brightest indirect sample, against fireflies; 0 clamps nothing.
        seed: of the noise; the same in all pictures, so that a video does not flicker.
        threads: of the renderer.
        pixel_filter: Cycles' own, soft and 1.5 pixels wide, or the mean over the pixel.
    """

    samples: int = 32
    denoise: bool = True
    clamp_indirect: float = 6.0
    seed: int = 0
    threads: int = 2
    pixel_filter: Literal["BLACKMAN_HARRIS", "BOX"] = "BLACKMAN_HARRIS"

    @staticmethod
    def truth(samples: int, threads: int) -> Quality:
        """Unbiased: no denoiser and no clamp."""
        return Quality(samples, denoise=False, clamp_indirect=0.0, threads=threads)

    def settings(self) -> dict[str, object]:
        """Settings that the pictures depend on, so without the threads."""
        return {key: value for key, value in asdict(self).items() if key != "threads"}


@dataclass(frozen=True)
class DistantLight:
    """Distant lamp that gives a white wall facing it the value `irradiance`; `size_deg` is its full angle."""

    direction: tuple[float, float, float]
    irradiance: float = 1.0
    size_deg: float = 2.0
    kind: Literal["distant"] = "distant"


@dataclass(frozen=True)
class PatchLight:
    """Rectangle of light that shines along -Z by Lambert's law, as bright as a white wall that reads 1.

    Attributes:
        center_cm: in room axes.
        size_cm: width and height.
    """

    center_cm: tuple[float, float, float]
    size_cm: tuple[float, float]
    kind: Literal["patch"] = "patch"


@dataclass(frozen=True)
class PanoramaLight:
    """Environment light from a panorama file in picture axes, its radiance times `strength`."""

    picture: str
    strength: float = 1.0
    kind: Literal["panorama"] = "panorama"


@dataclass(frozen=True, eq=False)
class Picture:
    """One picture to render.

    Attributes:
        path: an .exr file: linear RGBA, half floats, premultiplied over black.
        light: what lights it.
        shape: geometry that differs from the scene's, or None.
        all_passes: write depth, normals and albedo too, as a file of many layers.
    """

    path: Path
    light: DistantLight | PatchLight | PanoramaLight
    shape: Shape | None = None
    all_passes: bool = False


def write_job(folder: Path, scene: Scene, camera: Camera, quality: Quality, pictures: list[Picture]) -> Path:
    """Write a job into `folder` and return its file.

    Raises:
        StorageError: the folder cannot be written.
    """
    make_folder(folder)
    _save(folder / "scene.npz", _scene_arrays(scene))
    listed = []
    for index, picture in enumerate(pictures):
        shape = None
        if picture.shape is not None:
            shape = f"shape{index:04d}.npz"
            _save(folder / shape, picture.shape)
        listed.append(
            {
                "path": str(picture.path.resolve()),
                "light": asdict(picture.light),
                "shape": shape,
                "all_passes": picture.all_passes,
            }
        )
    job = {
        "scene": {
            "arrays": "scene.npz",
            "materials": scene.materials,
            "objects": [_description(each) for each in scene.objects],
        },
        "camera": {
            "focal_px": camera.focal_px,
            "width": camera.size[0],
            "height": camera.size[1],
            "position_cm": camera.position_cm.tolist(),
        },
        "quality": asdict(quality),
        "pictures": listed,
    }
    write_atomic(folder / JOB_FILE, json.dumps(job))
    return folder / JOB_FILE


def _scene_arrays(scene: Scene) -> dict[str, NDArray]:
    arrays: dict[str, NDArray] = {}
    for each in scene.objects:
        if isinstance(each, Strands):
            fields: dict[str, NDArray] = {"points": each.points, "radius": each.radius, "shade": each.shade}
        else:
            fields = {"vertices": each.vertices, "faces": each.faces, "slots": each.slots, **each.attributes}
            if each.uv is not None:
                fields["uv"] = each.uv
        arrays |= {f"{each.name}.{name}": values for name, values in fields.items()}
    return arrays


def _description(each: Mesh | Strands) -> dict[str, Any]:
    if isinstance(each, Strands):
        return {"kind": "strands", "name": each.name, "materials": [each.material]}
    return {
        "kind": "mesh",
        "name": each.name,
        "materials": list(each.materials),
        "attributes": list(each.attributes),
        "subdivision": each.subdivision,
    }


def _save(path: Path, arrays: Mapping[str, NDArray]) -> None:
    compact = {
        key: values.astype(np.float32) if values.dtype == np.float64 else values for key, values in arrays.items()
    }
    with atomic_path(path) as temporary:
        np.savez(temporary, allow_pickle=False, **compact)
