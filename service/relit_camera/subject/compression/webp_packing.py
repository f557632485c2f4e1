"""Packing a subject for shipping: fewer principal pictures, all kept in one lossless WebP picture of 8 bits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import InputError, SubjectError
from relit_camera.base.images.decoder_messages import suppress_decoder_messages
from relit_camera.base.images.image_limits import MAX_IMAGE_PIXELS, image_header
from relit_camera.base.images.image_quality import psnr
from relit_camera.subject.compression.local_basis import global_basis
from relit_camera.subject.subject import Subject

_MAX_WEBP_SIDE = 16383
"""Largest side, in pixels, of a WebP picture."""
_LIGHTS_PER_BATCH = 32
"""Lights restored at a time."""


def pack_subject(subject: Subject, components: int) -> Subject:
    """The subject reduced to its `components` first principal pictures, as `write_subject` with `small` stores them.

    Lights are weighted by the energy of their pictures, so environments, which mix all of them, are most accurate; a
    single lamp from behind loses most. `metadata.psnr_db` becomes the worst over the captured lights, against the given
    subject's pictures of them.

    Raises:
        InputError: the subject has no more components than that.
    """
    meta = subject.metadata
    if not 1 <= components < meta.components:
        raise InputError(
            f"the subject has {meta.components} components, and {components} were asked for",
            "ask for fewer than it has",
        )
    lights = subject.light_coefficients.astype(np.float64)
    gram = subject.basis.gram()
    _, vectors = np.linalg.eigh(lights.T @ gram @ lights)
    mixed = lights @ vectors[:, ::-1][:, :components]
    found = subject.pictures(mixed.astype(np.float32))
    scale = np.abs(found).reshape(components, -1).max(axis=1) + 1e-20
    rounded = encode_basis((found / scale[:, None, None, None]).transpose(3, 0, 1, 2))
    basis = decode_basis(rounded, (3, components, meta.height, meta.width))
    # Orthogonal projection of every picture onto those kept.
    projection = np.linalg.solve(mixed.T @ gram @ mixed, mixed.T @ gram) * scale[:, None]
    small = replace(
        subject,
        metadata=meta.model_copy(
            update={
                "format_version": 1,
                "components": components,
                "texel_psnr_db": None,
                "map_psnr_db": None,
                "bytes_share": None,
            }
        ),
        basis=global_basis(basis, subject.matte),
        coefficients=(projection @ subject.coefficients).astype(np.float32),
        light_coefficients=(projection @ lights).astype(np.float32),
        normals=None,
        albedo=None,
        depth=None,
        horizons=None,
    )
    worst = min(light_psnrs_db(small, subject))
    return replace(small, metadata=small.metadata.model_copy(update={"psnr_db": min(worst, 200.0)}))


def light_psnrs_db(subject: Subject, reference: Subject) -> list[float]:
    """PSNR in dB of each captured light's picture from one form of a subject against that from another."""
    return [
        psnr(seen, expected, reference.matte)
        for seen, expected in zip(_light_pictures(subject), _light_pictures(reference), strict=True)
    ]


def encode_basis(basis: NDArray) -> NDArray[np.uint8]:
    """Principal pictures (3, components, height, width) within -1..1 as one lossless WebP picture: bytes (count,).

    They are tiled in a grid. A value is stored as its sign and the root of its magnitude in steps of 1/127: finer near
    zero, where most values lie.

    Raises:
        InputError: they are too many or too large for one WebP picture.
        ValueError: a value is beyond −1..1, which would come back as another.
    """
    _, components, height, width = basis.shape
    across, down = _grid(components)
    sides = across * width, down * height
    if max(sides) > _MAX_WEBP_SIDE or sides[0] * sides[1] > MAX_IMAGE_PIXELS:
        raise InputError(
            f"{components} pictures of {width}x{height} do not fit into one WebP picture", "keep fewer components"
        )
    if not np.abs(basis).max() <= 1.001:  # rounding
        raise ValueError("principal pictures beyond -1..1 cannot be stored as one picture")
    rooted = np.sign(basis) * np.sqrt(np.abs(basis.astype(np.float32)))
    codes = np.full((3, across * down, height, width), 128, np.uint8)
    codes[:, :components] = np.rint(rooted * 127 + 128).astype(np.uint8)
    tiled = codes.reshape(3, down, across, height, width).transpose(1, 3, 2, 4, 0)
    picture = tiled.reshape(down * height, across * width, 3)
    # In OpenCV a quality above 100 means lossless.
    _, encoded = cv2.imencode(".webp", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_WEBP_QUALITY, 101])
    return np.asarray(encoded, np.uint8).ravel()


def decode_basis(encoded: NDArray[np.uint8], shape: tuple[int, int, int, int]) -> NDArray[np.float16]:
    """The principal pictures (3, components, height, width) from `encode_basis`, rounded to its steps.

    Raises:
        SubjectError: the bytes are no such picture.
    """
    _, components, height, width = shape
    across, down = _grid(components)
    picture = None
    if encoded.ndim == 1 and _header_has_size(encoded.tobytes(), (across * width, down * height)):
        with suppress_decoder_messages():
            picture = cv2.imdecode(np.array(encoded), cv2.IMREAD_UNCHANGED)
    if picture is None or picture.shape != (down * height, across * width, 3):
        raise SubjectError("its principal pictures cannot be decoded", "restore the file from a copy")
    colored = cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
    tiled = colored.reshape(down, height, across, width, 3).transpose(4, 0, 2, 1, 3)
    codes = tiled.reshape(3, across * down, height, width)[:, :components]
    rooted = (np.arange(256, dtype=np.float32) - 128) / 127
    table = (np.sign(rooted) * rooted**2).astype(np.float16)
    pictures = np.empty(codes.shape, np.float16)
    for channel, component in np.ndindex(3, components):  # NumPy makes indices of 64 bits of what it looks up at once
        pictures[channel, component] = table[codes[channel, component]]
    return pictures


def _header_has_size(data: bytes, size: tuple[int, int]) -> bool:
    """Whether a picture file's header gives this size, and decoders accept it."""
    try:
        return image_header(data).size == size and size[0] * size[1] <= MAX_IMAGE_PIXELS
    except ValueError:
        return False


def _grid(components: int) -> tuple[int, int]:
    """Columns and rows of a near-square grid of that many pictures."""
    across = int(np.ceil(np.sqrt(components)))
    return across, -(-components // across)


def _light_pictures(subject: Subject) -> Iterator[NDArray[np.float32]]:
    # In batches: all together they take gigabytes.
    for start in range(0, subject.metadata.lights, _LIGHTS_PER_BATCH):
        yield from subject.pictures(subject.light_coefficients[:, start : start + _LIGHTS_PER_BATCH])
