"""Reading of the worker's EXR files, with alpha and all layers, which the service's reader ignores."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ImageError
from relit_camera.base.images.image_types import LinearImage, Mask

Planes = dict[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Passes:
    """Render passes of a picture; (h, w, …) float32.

    Attributes:
        picture: linear RGB, premultiplied over black.
        alpha: 0..1.
        normals: unit, in our axes; zero where there is nothing.
        albedo: linear RGB, premultiplied.
        depth_cm: distance from the camera along its axis; infinite where there is nothing.
    """

    picture: LinearImage
    alpha: Mask
    normals: NDArray[np.float32]
    albedo: LinearImage
    depth_cm: NDArray[np.float32]


def read_rgba(path: Path) -> tuple[LinearImage, Mask]:
    """Picture (h, w, 3), premultiplied over black, and alpha (h, w).

    Raises:
        ImageError: it cannot be read, or has no alpha.
    """
    planes = _read(path)
    return _stack(planes, path, "", "RGB"), _stack(planes, path, "", "A")[..., 0]


def read_passes(path: Path) -> Passes:
    """Read a picture of all passes.

    Raises:
        ImageError: it cannot be read, or a pass is missing.
    """
    planes = _read(path)
    x, y, z = np.moveaxis(_stack(planes, path, "Normal", "XYZ"), -1, 0)
    # Blender's axes are (x, -z, y) of ours.
    normals = np.stack([x, z, -y], axis=-1)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    depth = _stack(planes, path, "Depth", "Z")[..., 0]
    return Passes(
        picture=_stack(planes, path, "Combined", "RGB"),
        alpha=_stack(planes, path, "Combined", "A")[..., 0],
        normals=np.where(length > 1e-3, normals / np.maximum(length, 1e-3), 0).astype(np.float32),
        albedo=_stack(planes, path, "Denoising Albedo", "RGB"),
        depth_cm=np.where(depth > 1e9, np.inf, depth).astype(np.float32),
    )


def _read(path: Path) -> Planes:
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            return {
                name: np.asarray(channel.pixels, np.float32)
                for part in file.parts
                for name, channel in part.channels.items()
            }
    except Exception as error:  # OpenEXR raises RuntimeError, ValueError or its own types for damaged files
        raise ImageError(f"{path} cannot be read as OpenEXR: {error}", "delete it and render again") from error


def _stack(planes: Planes, path: Path, layer: str, channels: str) -> NDArray[np.float32]:
    found = []
    for channel in channels:
        suffix = f"{layer}.{channel}" if layer else channel
        plane = next((plane for name, plane in planes.items() if name == suffix or name.endswith(f".{suffix}")), None)
        if plane is None:
            raise ImageError(f"{path} has no channel {suffix}, but {', '.join(sorted(planes))}", "render it again")
        found.append(plane)
    return np.stack(found, axis=-1)
