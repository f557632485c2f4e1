"""The subject at half its size, for what needs less detail: a quarter of the products."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import DisplayImage, Mask
from relit_camera.subject.compression.local_basis import LocalBasis
from relit_camera.subject.subject import Subject


def half_size_subject(subject: Subject) -> Subject:
    """The subject in blocks of 2 × 2 pixels, each the mean of those of its pixels that lie in one cluster.

    Without what relighting does not need: normals, albedo, depth, horizons and expression stills.
    """
    width, height = (-(-side // 2) for side in subject.size)
    return Subject(
        metadata=subject.metadata.model_copy(update={"width": width, "height": height}),
        basis=half_size_basis(subject.basis, subject.size),
        coefficients=subject.coefficients,
        light_directions=subject.light_directions,
        light_coefficients=subject.light_coefficients,
        matte=_halved(subject.matte),
        neutral=_halved(subject.neutral),
        landmarks={scheme: points / np.float32(2) for scheme, points in subject.landmarks.items()},
    )


def half_size_basis(basis: LocalBasis, size: tuple[int, int]) -> LocalBasis:
    """The rows of blocks of 2 × 2 pixels of a picture of `size` (width, height), each in its largest cluster there.

    Where every cluster has a block, `first`, `scales` and `mixes` are the very arrays of `basis`.
    """
    width = size[0]
    half_width = -(-width // 2)
    clusters = [np.unique(cluster, return_index=True) for cluster in basis.pixels]
    owner, counts = _owners([pixels for pixels, _ in clusters], width, half_width, -(-size[1] // 2))
    found: list[NDArray[np.int32]] = []
    values: list[NDArray] = []
    for index, (pixels, places) in enumerate(clusters):
        part = basis.values[basis.first[index] : basis.first[index + 1]]
        blocks = _block_of(pixels, width, half_width)
        inside = np.flatnonzero(owner[blocks] == index)
        inside = inside[np.argsort(blocks[inside], kind="stable")]
        own, starts = np.unique(blocks[inside], return_index=True)
        found.append(own.astype(np.int32))
        ordered = part[:, :, places[inside]].astype(np.float32)
        means = np.add.reduceat(ordered, starts, axis=2) / counts[own] if len(own) else ordered
        values.append((np.rint(means) if part.dtype == np.int8 else means).astype(part.dtype))
    most = max(len(blocks) for blocks in found)
    chosen = [index for index, blocks in enumerate(found) if len(blocks)]
    pixels = np.stack([np.pad(found[i], (0, most - len(found[i])), "edge") for i in chosen])
    halved = np.concatenate(
        [np.pad(values[i], ((0, 0), (0, 0), (0, most - values[i].shape[2])), "edge") for i in chosen]
    )
    if len(chosen) == len(clusters):
        return replace(basis, pixels=pixels, values=halved)
    components = np.concatenate([np.arange(basis.first[i], basis.first[i + 1]) for i in chosen])
    return LocalBasis(
        pixels=pixels,
        first=np.concatenate([[0], np.cumsum([len(values[i]) for i in chosen])]).astype(np.int32),
        values=halved,
        scales=basis.scales[components],
        mixes=basis.mixes[components],
    )


def _owners(
    clusters: list[NDArray[np.int32]], width: int, half_width: int, half_height: int
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """For each block the cluster with most of its pixels, −1 for none, and how many these are."""
    count = half_width * half_height
    owner, most = np.full(count, -1, np.intp), np.zeros(count, np.float32)
    for index, pixels in enumerate(clusters):
        mine = np.bincount(_block_of(pixels, width, half_width), minlength=count)
        larger = mine > most
        owner[larger], most[larger] = index, mine[larger]
    return owner, most


def _block_of(pixels: NDArray[np.int32], width: int, half_width: int) -> NDArray[np.int32]:
    return np.asarray(pixels // width // 2 * half_width + pixels % width // 2, np.int32)


def _halved(picture: Mask | DisplayImage) -> NDArray[Any]:
    """The means of its blocks of 2 × 2 pixels; an odd last row or column counts twice."""
    rows, columns = picture.shape[:2]
    even = cv2.copyMakeBorder(picture, 0, rows % 2, 0, columns % 2, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(even, (even.shape[1] // 2, even.shape[0] // 2), interpolation=cv2.INTER_AREA))
