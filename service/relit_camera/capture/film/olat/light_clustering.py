"""Pictures under nearly the same light merged into one with less noise, as if the flash were distant and steady."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from relit_camera.base.array_types import Indices
from relit_camera.base.concurrency.threads import worker_pool
from relit_camera.base.images.image_types import Mask
from relit_camera.capture.film.olat.flash_strength import FlashStrengths
from relit_camera.capture.film.olat.near_field import distant_light_factor


@dataclass(frozen=True)
class ClusterTunables:
    """How pictures are merged; `relit evaluate field` (docs/evaluate.md) shows the effect of a change.

    Attributes:
        max_lights: most pictures after merging.
        merge_angle_deg: lights no farther apart are merged; lights farther apart too where there are too many.
        max_merged: most pictures that are merged into one; twice as many would make hardly less noise.
        subsample: pictures that are kept of a cluster where a film has more than memory holds.
        half_difference: difference from the median at which a pixel's value counts half; white is 1.
    """

    max_lights: int = 160
    merge_angle_deg: float = 1.5
    max_merged: int = 9
    subsample: int = 3
    half_difference: float = 0.08


_TUNABLES = ClusterTunables()


def cluster_lights(directions: NDArray[np.float64], most: int = _TUNABLES.max_lights) -> list[Indices]:
    """At most `most` clusters of unit vectors (count, 3) that are close together, as arrays of indices.

    Complete linkage: no two vectors of a cluster are farther apart than a limit, which is as small as possible but no
    smaller than the merging angle.
    """
    if len(directions) == 1:
        return [np.array([0])]
    tree = linkage(directions, "complete")
    limit = max(2 * np.sin(np.radians(_TUNABLES.merge_angle_deg) / 2), _merge_distance(tree[:, 2], most))
    labels = fcluster(tree, limit, "distance")
    return [np.flatnonzero(labels == label) for label in np.unique(labels)]


def subsample_evenly(directions: NDArray[np.float64], most: int) -> Indices:
    """Growing indices of at most `most` unit vectors (count, 3); where they are dense, more are left out."""
    if len(directions) <= most:
        return np.arange(len(directions))
    clusters = cluster_lights(directions, most // _TUNABLES.subsample)
    return np.sort(np.concatenate([subsample_cluster(each, _TUNABLES.subsample) for each in clusters]))


def subsample_cluster(cluster: Indices, most: int = _TUNABLES.max_merged) -> Indices:
    """At most `most` members of a cluster, spread evenly over it."""
    if len(cluster) <= most:
        return cluster
    return np.asarray(cluster[np.linspace(0, len(cluster) - 1, most).round().astype(np.intp)])


def merge_pictures(pictures: NDArray[np.float32], weights: NDArray[np.float64]) -> NDArray[np.float32]:
    """Weighted mean (height, width, 3) of aligned pictures (count, height, width, 3) with weights (count,).

    Of three pictures or more, a value counts less the farther it is from the median (M-estimator).
    """
    if len(pictures) == 1:
        return np.asarray(pictures[0])
    counted = weights.astype(np.float32)[:, None, None, None]
    if len(pictures) > 2:
        difference = np.abs(pictures - np.median(pictures, axis=0)).mean(axis=3, keepdims=True)
        counted = counted / (1 + (difference / np.float32(_TUNABLES.half_difference)) ** 2)
    return np.asarray((pictures * counted).sum(axis=0) / counted.sum(axis=0), np.float32)


def _merge_distance(heights: NDArray[np.float64], most: int) -> float:
    """Distance up to which clusters must be merged so that at most `most` are left, by the heights of the merges."""
    merges = len(heights) + 1 - most
    return float(heights[merges - 1]) + 1e-12 if merges > 0 else 0.0


def merge_lights(
    pictures: NDArray[np.floating],
    strengths: FlashStrengths,
    clusters: Sequence[Indices],
    matte: Mask,
    *,
    near_field: bool = True,
) -> NDArray[np.float32]:
    """Merge each cluster of pictures into one, as under a distant flash of typical strength; black outside the matte.

    Args:
        pictures: (lights, size, size, 3) linear RGB of one flash each.
        strengths: of the flashes.
        clusters: indices of the pictures to merge.
        matte: (size, size) the person's alpha.
        near_field: whether the lamp's nearness is corrected.

    Returns:
        (clusters, size, size, 3) linear RGB, not negative.
    """

    def merged(cluster: Indices) -> NDArray[np.float32]:
        surface = strengths.surface.resized((matte.shape[1], matte.shape[0]))
        scaled = []
        for each in cluster:
            factor = distant_light_factor(surface, strengths.lamps[each]) if near_field else np.ones_like(matte)
            scale = (factor * (matte > 0) / np.float32(strengths.strength[each]))[..., None]
            scaled.append(pictures[each].astype(np.float32) * scale)
        # The picture of a weak flash is amplified, and its noise with it.
        return np.maximum(merge_pictures(np.stack(scaled), strengths.strength[cluster] ** 2), 0)

    found = np.empty((len(clusters), *matte.shape, 3), np.float32)
    with worker_pool() as pool:
        for row, picture in enumerate(pool.map(merged, clusters)):
            found[row] = picture
    return found
