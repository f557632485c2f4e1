"""Building a subject from samples: the compressed field, neutral picture, landmarks, geometry and header."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from relit_camera import __version__
from relit_camera.base.images.color import Gamma, luminance, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask, Points
from relit_camera.capture.geometry.shape_estimation import Geometry
from relit_camera.capture.reflectance.method_registry import DEFAULT_METHOD, open_method
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_landmarks import find_landmarks
from relit_camera.light.directions import texel_directions, texel_solid_angles
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_camera.subject.compression.accuracy_target import CompressionTarget
from relit_camera.subject.compression.field_compression import CompressedField, compress_field
from relit_camera.subject.measured_light import measured_fraction
from relit_camera.subject.reflectance_field import ReflectanceField
from relit_camera.subject.rungs import EXPECTED_DB, Rung
from relit_camera.subject.subject import HORIZON_STEP_RAD, Subject, SubjectMetadata

MAX_SKIN_LUMINANCE = 0.45
"""Upper bound of the 75th percentile of a face's luminance under frontal light, where a white wall reads 1."""
TYPICAL_SKIN_LUMINANCE = 0.36
"""The same percentile for light skin."""


def build_subject(
    samples: OlatSamples,
    method: str,
    source: str,
    gamma: Gamma = "srgb",
    landmarks: Mapping[str, Points] | None = None,
    with_geometry: bool = True,
    rung: Rung = "pictures",
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Subject:
    """Build and compress the field of `samples`.

    Args:
        samples: aligned one-light pictures.
        method: a name that `capture.reflectance.method_registry.open_method` knows.
        source: file name of the capture, for the header.
        gamma: curve that the pictures were decoded with, for the header.
        landmarks: known landmarks by scheme; None finds them with the installed trackers.
        with_geometry: whether to store the person's geometry in the subject.
        rung: how the person was captured.
        progress: called with the number of tiles that are compressed and the total.

    Raises:
        NotFoundError: no such method.
        LightsError: the directions cannot carry a field.
    """
    method = DEFAULT_METHOD if method == "default" else method
    field = open_method(method).build(samples)
    return subject_from_field(field, samples, method, source, gamma, landmarks, with_geometry, rung, progress=progress)


def subject_from_field(
    field: ReflectanceField,
    samples: OlatSamples,
    method: str,
    source: str,
    gamma: Gamma = "srgb",
    landmarks: Mapping[str, Points] | None = None,
    with_geometry: bool = True,
    rung: Rung = "pictures",
    accuracy: CompressionTarget | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Subject:
    """Compress a field that was built from samples.

    Args:
        field: of the person.
        samples: the pictures that it was built from.
        method: name of what built it, for the header.
        source: file name of the capture, for the header.
        gamma: curve that the pictures were decoded with, for the header.
        landmarks: known landmarks by scheme; None finds them with the installed trackers.
        with_geometry: whether to store the person's geometry in the subject.
        rung: how the person was captured.
        accuracy: of the compression; the default one where None.
        progress: called with the number of tiles that are compressed and the total.
    """
    maps = [builtin_light_map(name) for name in BUILTIN_NAMES]
    target = replace(accuracy or CompressionTarget(), maps=maps)
    compressed = compress_field(field, samples.pictures, samples.matte, target, progress)
    quality = compressed.quality
    frontal = frontal_picture(compressed, samples.matte)
    neutral = neutral_picture(frontal, samples.matte)
    lights, height, width = samples.pictures.shape[:3]
    return Subject(
        metadata=SubjectMetadata(
            width=width,
            height=height,
            method=method,
            lights=lights,
            components=compressed.basis.components,
            source=source,
            psnr_db=quality.light_db,
            texel_psnr_db=quality.texel_db,
            map_psnr_db=quality.map_db,
            bytes_share=quality.bytes_share,
            gamma=str(gamma),
            over_black=over_black(samples),
            display_gain=display_gain(frontal, samples.matte),
            rung=rung,
            expected_db=EXPECTED_DB.get(rung),
            measured_fraction=measured_fraction(samples.directions),
            created_by=f"relit-camera {__version__}",
            created_at=datetime.now(UTC).isoformat(timespec="seconds"),
        ),
        basis=compressed.basis,
        coefficients=compressed.coefficients,
        light_directions=samples.directions.astype(np.float32),
        light_coefficients=compressed.light_coefficients,
        matte=samples.matte,
        neutral=neutral,
        landmarks=find_landmarks(neutral) if landmarks is None else landmarks,
        stills=(),
        **(quantize_geometry(samples.geometry) if with_geometry else {}),
    )


def quantize_geometry(geometry: Geometry) -> dict[str, NDArray]:
    """The geometry arrays of a subject: normals, albedo, depth, horizons (see `Subject`).

    Half floats resolve normals to 0.03° and albedo to 0.05 %, far below the errors of photometric stereo; a horizon's
    step of 0.7° is less than the size of a light.
    """
    horizons = np.rint((geometry.horizon.heights.astype(np.float32) + np.pi / 2) / HORIZON_STEP_RAD)
    return {
        "normals": geometry.normals.astype(np.float16),
        "albedo": geometry.albedo.astype(np.float16),
        "depth": np.nan_to_num(geometry.depth, nan=0.0),
        "horizons": np.clip(horizons, 0, 255).astype(np.uint8),
    }


def frontal_picture(field: CompressedField, matte: Mask) -> LinearImage:
    """The linear picture under a cosine lobe of light about the camera, in which a white wall facing it reads 1."""
    lobe = np.maximum(texel_directions()[..., 2], 0) * texel_solid_angles()
    lobe /= (lobe * np.maximum(texel_directions()[..., 2], 0)).sum()
    amounts = field.coefficients @ lobe.ravel().astype(np.float32)
    return field.basis.at(amounts[:, None], np.arange(matte.size)).reshape(*matte.shape, 3)


def over_black(samples: OlatSamples) -> bool:
    """Whether everything outside the matte is black (below 0.02) in every frame."""
    outside = samples.matte == 0
    return bool(outside.any() and samples.pictures[:, outside].max() < 0.02)


def display_gain(frontal: LinearImage, matte: Mask) -> float:
    """Factor from the pictures to displayed values: 1 for a calibrated capture.

    No skin is nearly as bright as a white wall. Where the frames are that bright, their unit is unknown (a strobe of
    unknown strength), and the face is scaled to the luminance of light skin.
    """
    bright = float(np.percentile(luminance(frontal)[matte > 0.5], 75))
    return 1.0 if bright <= MAX_SKIN_LUMINANCE else TYPICAL_SKIN_LUMINANCE / bright


def neutral_picture(frontal: LinearImage, matte: Mask) -> DisplayImage:
    """The frontal picture as uint8 sRGB, exposed so that trackers find the face: its 95th percentile becomes 0.7."""
    bright = float(np.percentile(frontal[matte > 0.5], 95))
    return uint8_from_linear(frontal * np.float32(0.7 / bright if bright > 0 else 1.0))
