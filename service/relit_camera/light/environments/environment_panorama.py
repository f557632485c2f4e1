"""Panoramas and environments: light from all sides, read from latitude-longitude picture files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.concurrency.decoding_process import DECODING_PROCESS, Decoded
from relit_camera.base.errors import ImageError, PanoramaError
from relit_camera.base.images.image_files import read_linear
from relit_camera.base.images.image_limits import image_header_of_file
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.environments.panorama_axes import Axes, between_map_and_picture_axes
from relit_camera.light.light_map import LightMap, resample_by_area, resample_to_light_map

PANORAMA_SUFFIXES = frozenset({".hdr", ".exr", ".png", ".jpg", ".jpeg"})
MAX_PANORAMA_PIXELS = 1 << 25
"""8192 × 4096. Several environments are kept in memory as float32: 400 MB each at that size."""
_MAX_RADIANCE = 1e9
"""Larger radiance is implausible (the sun is 3e4 to 1e5 times the sky) and would overflow sums in float32."""
_NEGATIVE_TOLERANCE = 1e-6
"""Negative values down to this share of the maximum are rounding errors of the writing program: set to 0."""
_CLIPPED_LEVEL = 0.99
"""Linear value from which an 8-bit picture counts as clipped: codes 254 and 255, since JPEG wobbles by one."""


@dataclass(frozen=True)
class Panorama:
    """Light from all sides at a file's resolution.

    Attributes:
        radiance: float32 (h, 2h, 3), linear RGB, non-negative, in map axes (row 0 up, the middle toward the camera).
        clipped_fraction: share of the sphere where an LDR picture is clipped at white; 0 for HDR.
        notes: remarks for the user, one sentence each.
    """

    radiance: NDArray[np.float32]
    clipped_fraction: float = 0.0
    notes: tuple[str, ...] = field(default=())


def read_panorama(path: Path, axes: Axes = "picture") -> Panorama:
    """Read a .hdr, .exr, .png or .jpg panorama.

    `.png` and `.jpg` are linearised by the sRGB curve; their clipped share is kept and said in a note. A picture in
    `picture` axes is mirrored. A width that misses 2:1 by one or two pixels is resampled by area.

    Raises:
        PanoramaError: missing, damaged, of another format, not 2:1, too large, black, or with NaN, infinite or negative
            values.
    """
    path = Path(path)
    _require_usable_header(path)
    try:
        image = read_linear(path)
    except ImageError as error:
        raise PanoramaError(error.what, error.cure) from error
    except OSError as error:
        raise _unreadable(path, error) from error
    clipped = _clipped_fraction(image) if path.suffix.lower() not in (".hdr", ".exr") else 0.0
    notes = () if clipped == 0 else (_clipped_note(clipped),)
    return Panorama(_to_map_axes(image, axes, str(path)), clipped, notes)


def read_panorama_apart(path: Path) -> Panorama:
    """What `read_panorama` gives of a file in `picture` axes, decoded in a process of its own.

    Raises:
        PanoramaError: as `read_panorama`.
        InputError: it takes too much memory or time, or ends its decoder.
        NotReadyError: no such process can be started.
    """
    decoded = DECODING_PROCESS.decode(_decode_panorama, path)
    (radiance,) = decoded.arrays
    return Panorama(radiance, decoded.facts["clipped_fraction"], tuple(decoded.facts["notes"]))


def _decode_panorama(path: Path) -> Decoded:
    panorama = read_panorama(path)
    facts = {"clipped_fraction": panorama.clipped_fraction, "notes": panorama.notes}
    return Decoded((panorama.radiance,), facts)


def panorama_from_radiance(radiance: NDArray[np.float32], name: str = "panorama") -> Panorama:
    """A panorama of radiance (h, about 2h, 3) in map axes, checked as a file's.

    Raises:
        PanoramaError: not 2:1, black, or with NaN, infinite or negative values.
    """
    height, width = radiance.shape[:2]
    _require_panorama_size(width, height, name)
    return Panorama(_to_map_axes(radiance, "map", name))


def require_panorama_suffix(suffix: str, name: str) -> None:
    """Check that a file of this suffix can be a panorama; `name` is the file's name in the message.

    Raises:
        PanoramaError: it cannot.
    """
    if suffix.lower() not in PANORAMA_SUFFIXES:
        raise PanoramaError(f"{name}: '{suffix}' is no panorama format known here", "use .hdr, .exr, .png or .jpg")


def _require_usable_header(path: Path) -> None:
    if path.is_dir() or not path.exists():
        raise PanoramaError(f"no panorama at {path}", "check the path")
    require_panorama_suffix(path.suffix, str(path))
    try:
        width, height = image_header_of_file(path).size
    except ValueError as error:
        raise PanoramaError(f"{path} cannot be read: {error}", "save or download it again") from error
    except OSError as error:
        raise _unreadable(path, error) from error
    _require_panorama_size(width, height, str(path))


def _unreadable(path: Path, error: OSError) -> PanoramaError:
    return PanoramaError(f"cannot read {path}: {error.strerror}", "check the path and your permission to read it")


def _require_panorama_size(width: int, height: int, name: str) -> None:
    size = f"{name} is {width}x{height} pixels"
    if width < 2 or height < 1 or abs(width - 2 * height) > 2:
        raise PanoramaError(
            f"{size}, not twice as wide as high", "use a 360° latitude-longitude (equirectangular) panorama"
        )
    if width * height > MAX_PANORAMA_PIXELS:
        raise PanoramaError(
            f"{size}, more than {MAX_PANORAMA_PIXELS / 1e6:.1f} million", "scale it down; 2048x1024 is plenty"
        )


def _to_map_axes(image: NDArray[np.float32], axes: Axes, name: str) -> NDArray[np.float32]:
    radiance = _require_usable_radiance(image, name)
    height = max(1, image.shape[1] // 2)
    if radiance.shape[:2] != (height, 2 * height):
        radiance = resample_by_area(radiance, height, 2 * height)
    return between_map_and_picture_axes(radiance) if axes == "picture" else np.ascontiguousarray(radiance)


def _require_usable_radiance(image: NDArray[np.float32], name: str) -> NDArray[np.float32]:
    """The image with rounding errors below 0 clamped; PanoramaError where it cannot be radiance."""
    cure = "export it again from the program that made it"
    lowest, highest = float(image.min()), float(image.max())
    if not (lowest >= -_MAX_RADIANCE and highest <= _MAX_RADIANCE):  # either is NaN if any value is
        usable = np.isfinite(image) & (np.abs(image) <= _MAX_RADIANCE)
        row, column = np.argwhere(~usable)[0][:2]
        raise PanoramaError(
            f"{name} holds NaN, infinity or values beyond 1e9, first at row {row}, column {column}", cure
        )
    if highest <= 0 and lowest >= 0:
        raise PanoramaError(f"{name} is all black", "use a panorama that has light in it")
    if lowest < -_NEGATIVE_TOLERANCE * highest:
        row, column = np.unravel_index(int(image.argmin()), image.shape)[:2]
        raise PanoramaError(f"{name} holds negative light, {lowest:.3g} at row {row}, column {column}", cure)
    return np.asarray(np.maximum(image, 0) if lowest < 0 else image, np.float32)


def _clipped_fraction(image: NDArray[np.float32]) -> float:
    clipped = (image >= _CLIPPED_LEVEL).any(axis=2)
    weights = texel_solid_angles(*image.shape[:2])
    return float((clipped * weights).sum() / weights.sum())


def _clipped_note(fraction: float) -> str:
    return (
        f"{100 * fraction:.2g} % of the sphere is clipped at white: its lamps and windows are dimmer here than they "
        "were. A .hdr or .exr panorama keeps them."
    )


@dataclass(frozen=True)
class Environment:
    """Light from all sides under a name.

    Attributes:
        name: name in the store, or the path it was read from.
        panorama: at the file's resolution, to show as a background.
        light_map: resampled to (32, 64, 3), to light with.
        notes: remarks for the user, one sentence each.
    """

    name: str
    panorama: Panorama
    light_map: LightMap
    notes: tuple[str, ...] = ()


def environment_from_panorama(name: str, panorama: Panorama) -> Environment:
    """The environment that a panorama shows, with the panorama's notes."""
    return Environment(name, panorama, resample_to_light_map(panorama.radiance), panorama.notes)
