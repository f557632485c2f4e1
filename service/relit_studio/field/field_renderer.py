"""One-light pictures of a person by Cycles, as `relit capture import` reads them, and their truth."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_files import write_display
from relit_camera.base.storage.atomic_files import atomic_path, write_atomic
from relit_camera.light.directions import fibonacci_directions
from relit_studio.base.assets.manifest import manifest
from relit_studio.base.progress import Progress, no_progress
from relit_studio.base.resume import keep_settings
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.exr import Passes, read_passes
from relit_studio.cycles.job import DistantLight, Picture, Quality, Scene
from relit_studio.cycles.person_objects import Figure
from relit_studio.cycles.runner import render
from relit_studio.mannequin.outputs.olat import gray, light_names, lights_text
from relit_studio.people.face.landmarks import canonical_origin, landmarks
from relit_studio.people.person import Person
from relit_studio.people.posture import Posture

_PASSES = "passes.exr"
_PASSES_SAMPLES = 96
_SOFT_FRONTAL = DistantLight((0.0, 0.35, 0.9367), size_deg=90.0)


@dataclass(frozen=True)
class FieldSettings:
    """Settings of a field.

    Attributes:
        lights: how many, spread evenly over the whole sphere.
        size: of the pictures, pixels.
        light_size_deg: full angle of the lamp.
        quality: of the one-light pictures.
    """

    lights: int = 253
    size: int = 256
    light_size_deg: float = 2.0
    quality: Quality = field(default_factory=Quality)


def render_field(
    person: Person, folder: Path, settings: FieldSettings, progress: Progress = no_progress
) -> dict[str, float]:
    """Render the neutral person under each light, except existing pictures; returns the seconds of each picture.

    `000.exr` … are linear, over black, under lamps of unit irradiance: a white wall that faces the lamp reads 1. Beside
    them `lights.lp`, `matte.png`, `neutral.png` (under a soft frontal lamp), `landmarks.json`, `truth.npz` (normals,
    linear albedo, depth in centimeters toward the camera from the canonical face's origin; float32) and `field.json`
    (settings, camera, credits).

    Raises:
        InputError: the folder holds a field of other settings.
        DeviceError: Cycles is not set up, or fails.
        StorageError: the folder cannot be written.
    """
    camera = Camera(settings.size)
    keep_settings(folder, "field.json", field_description(person, settings, camera))
    scene = Figure(person).scene()
    directions = fibonacci_directions(settings.lights)
    names = light_names(settings.lights)
    write_atomic(folder / "lights.lp", lights_text(names, directions))
    _write_truth(person, scene, camera, folder, settings.quality)
    pictures = [
        Picture(folder / name, DistantLight((x, y, z), size_deg=settings.light_size_deg))
        for name, (x, y, z) in zip(names, directions.tolist(), strict=True)
    ]
    return render(scene, camera, settings.quality, pictures, progress)


def field_description(person: Person, settings: FieldSettings, camera: Camera) -> dict[str, object]:
    """Content of `field.json`: settings that the pictures depend on, credits, and the camera."""
    return {
        "person": asdict(person.traits),
        "settings": {**asdict(settings), "quality": settings.quality.settings()},
        "camera": {
            **asdict(camera),
            "focal_px": camera.focal_px,
            "depth_zero_cm": _depth_zero_cm(person, camera),
        },
        "credits": list(manifest().credits.values()),
    }


def _write_truth(person: Person, scene: Scene, camera: Camera, folder: Path, quality: Quality) -> None:
    passes_quality = Quality.truth(_PASSES_SAMPLES, quality.threads)
    render(scene, camera, passes_quality, [Picture(folder / _PASSES, _SOFT_FRONTAL, all_passes=True)])
    passes = read_passes(folder / _PASSES)
    write_display(folder / "matte.png", gray(np.clip(passes.alpha, 0, 1)))
    write_display(folder / "neutral.png", uint8_from_linear(passes.picture))
    pixels = {
        scheme: camera.project(points).astype(np.float64).round(3).tolist()
        for scheme, points in landmarks(person, Posture()).items()
    }
    write_atomic(folder / "landmarks.json", json.dumps(pixels))
    with atomic_path(folder / "truth.npz") as temporary:
        np.savez_compressed(
            temporary, normals=passes.normals, albedo=passes.albedo, depth=_depth(person, passes, camera)
        )


def _depth(person: Person, passes: Passes, camera: Camera) -> NDArray[np.float32]:
    """Centimeters toward the camera from the canonical face's origin (h, w); zero where there is nothing."""
    toward = _depth_zero_cm(person, camera) - passes.depth_cm
    return np.where(np.isfinite(toward), toward, 0).astype(np.float32)


def _depth_zero_cm(person: Person, camera: Camera) -> float:
    """Distance from the camera to the canonical face's origin, where depth is 0."""
    origin, _ = canonical_origin(person.model)
    return float(camera.distance_cm - origin[2])
