"""Samples → subject: the field, compressed, with what trackers and people need to see."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime

import numpy as np

from relit_camera import __version__
from relit_camera.capture.landmarks import find_landmarks
from relit_camera.errors import InputError
from relit_camera.reflectance.method import DEFAULT_METHOD, open_method
from relit_camera.reflectance.samples import Samples
from relit_camera.space.colour import Gamma, uint8_from_linear
from relit_camera.space.directions import texel_directions, texel_solid_angles
from relit_camera.space.images import DisplayImage, Points
from relit_camera.subject.compress import compress
from relit_camera.subject.field import FactoredField
from relit_camera.subject.subject import Subject, SubjectMetadata


def build_subject(
    samples: Samples,
    method: str,
    source: str,
    gamma: Gamma = "srgb",
    landmarks: Mapping[str, Points] | None = None,
) -> Subject:
    """Build and compress the field of `samples`.

    Args:
        samples: aligned one-light pictures.
        method: a name that `reflectance.method.open_method` knows.
        source: file name that the header should tell.
        gamma: the curve that the pictures were decoded with, for the header.
        landmarks: known points of the face by scheme; where none are given, the
            installed trackers look for them.

    Raises:
        NotFoundError: no such method.
        LightsError: the directions cannot carry a field.
    """
    method = DEFAULT_METHOD if method == "default" else method
    field = open_method(method).build(samples)
    if not isinstance(field, FactoredField):
        raise InputError(f"the field of method '{method}' cannot be compressed yet", "use barycentric, planar or nearest")
    still = neutral_picture(field, samples)
    compressed = compress(field, samples.matte)
    lights, height, width = samples.pictures.shape[:3]
    return Subject(
        metadata=SubjectMetadata(
            width=width,
            height=height,
            method=method,
            lights=lights,
            components=compressed.basis.shape[1],
            source=source,
            psnr_db=min(compressed.psnr_db, 200.0),
            gamma=str(gamma),
            created_by=f"relit-camera {__version__}",
            created_at=datetime.now(UTC).isoformat(timespec="seconds"),
        ),
        basis=compressed.basis,
        coefficients=compressed.coefficients,
        light_directions=samples.directions.astype(np.float32),
        light_coefficients=compressed.light_coefficients,
        matte=samples.matte,
        neutral=still,
        landmarks=landmarks or find_landmarks(still),
    )


def neutral_picture(field: FactoredField, samples: Samples) -> DisplayImage:
    """The face under soft light from the front: a cosine lobe about the camera, scaled so that skin is well exposed."""
    lobe = np.maximum(texel_directions()[..., 2], 0) * texel_solid_angles()
    mixed = np.tensordot(field.weights @ lobe.ravel().astype(np.float32), field.pictures, axes=(0, 0))
    bright = float(np.percentile(mixed[samples.matte > 0.5], 95))
    return uint8_from_linear(mixed * (0.7 / bright if bright > 0 else 1.0))
