"""Small truths that several tests share: a Lambertian sphere with a shadowing bump, lit from known directions."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.color import srgb_encode
from relit_camera.capture.reflectance.olat_samples import OlatSamples


def fibonacci_directions(count: int, lowest_z: float = -1.0) -> NDArray[np.float64]:
    """Directions (n, 3) spread evenly over the sphere, those with z of at least `lowest_z`."""
    y = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    directions = np.stack([np.sqrt(1 - y * y) * np.sin(angle), y, np.sqrt(1 - y * y) * np.cos(angle)], axis=1)
    return directions[directions[:, 2] >= lowest_z]


def sphere_surface(size: int = 48) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Unit normals (size, size, 3), which are its positions as well, and the mask of a sphere."""
    x, y = np.meshgrid((np.arange(size) + 0.5) / size * 2 - 1, 1 - (np.arange(size) + 0.5) / size * 2)
    inside = x * x + y * y < 0.96
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    return np.stack([x, y, z], axis=-1), inside


BUMP_CENTRE = np.array([0.25, 0.1, 1.05])
BUMP_RADIUS = 0.22


def render_sphere(
    light: NDArray[np.float64], size: int = 48, turn: NDArray[np.float64] | None = None
) -> NDArray[np.float32]:
    """A white Lambertian unit sphere with a small ball before it that casts a shadow, under a distant light.

    The ball itself is not seen; radiance is max(0, n·l), 0 in its shadow. (size, size, 3) float32. `turn` (3, 3) turns
    the sphere and its ball in the room, where the light stays; each pixel then shows the same spot of the sphere as
    before, wherever that has gone.
    """
    turn = np.eye(3) if turn is None else turn
    spots, inside = sphere_surface(size)
    points = spots @ turn.T
    shade = np.maximum(points @ light, 0)
    towards = turn @ BUMP_CENTRE - points
    along = towards @ light
    distance = np.linalg.norm(towards - along[..., None] * light, axis=-1)
    shade[(along > 0) & (distance < BUMP_RADIUS)] = 0
    return np.repeat((shade * inside).astype(np.float32)[..., None], 3, axis=2)


def sphere_samples(count: int = 300, size: int = 32, lowest_z: float = -1.0) -> OlatSamples:
    """One-light pictures of the sphere, without colour."""
    directions = fibonacci_directions(count, lowest_z)
    pictures = np.stack([render_sphere(light, size) for light in directions])
    matte = sphere_surface(size)[1].astype(np.float32)
    return OlatSamples(pictures, directions, matte)


def write_lights(folder: Path, samples: OlatSamples, suffix: str = ".png") -> Path:
    """Write samples as sRGB pictures with a matte and a lights.lp; returns the .lp."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [str(len(samples.directions))]
    for index, (picture, direction) in enumerate(zip(samples.pictures, samples.directions, strict=True)):
        name = f"{index:03d}{suffix}"
        cv2.imwrite(str(folder / name), np.round(srgb_encode(picture) * 255).astype(np.uint8)[..., ::-1])
        lines.append(f"{name} {direction[0]:.8f} {direction[1]:.8f} {direction[2]:.8f}")
    cv2.imwrite(str(folder / "matte.png"), (samples.matte * 255).astype(np.uint8))
    path = folder / "lights.lp"
    path.write_text("\n".join(lines) + "\n")
    return path
