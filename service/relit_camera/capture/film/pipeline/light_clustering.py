"""Pictures under nearly the same light as one picture, with less noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

MAX_LIGHTS = 160
MERGE_ANGLE_DEG = 1.5
"""Pictures under lights that are no farther apart are merged; farther ones too, where there are too many."""

_A_GROUP = 3
"""Pictures that are kept of a group."""
MAX_MERGED = 9
"""Pictures that are merged at most: as many again make hardly less noise."""
_AGREE = 0.08
"""Difference to the median, of white, at which a pixel's value counts half."""


def cluster_lights(directions: NDArray[np.float64], most: int = MAX_LIGHTS) -> list[NDArray[np.intp]]:
    """Groups of unit vectors (count, 3) that lie close together, at most `most`, as indices.

    By complete linkage: no two of a group are farther apart than its limit, which is as small as can be.
    """
    if len(directions) == 1:
        return [np.array([0])]
    tree = linkage(directions, "complete")
    limit = max(2 * np.sin(np.radians(MERGE_ANGLE_DEG) / 2), _limit(tree[:, 2], most))
    labels = fcluster(tree, limit, "distance")
    return [np.flatnonzero(labels == label) for label in np.unique(labels)]


def subsample_evenly(directions: NDArray[np.float64], most: int) -> NDArray[np.intp]:
    """At most so many unit vectors (count, 3), as growing indices: those are left out that many others are near to."""
    if len(directions) <= most:
        return np.arange(len(directions))
    groups = cluster_lights(directions, most // _A_GROUP)
    return np.sort(np.concatenate([subsample_cluster(group, _A_GROUP) for group in groups]))


def subsample_cluster(group: NDArray[np.intp], most: int = MAX_MERGED) -> NDArray[np.intp]:
    """At most so many of a group, spread evenly over it."""
    if len(group) <= most:
        return group
    return np.asarray(group[np.linspace(0, len(group) - 1, most).round().astype(np.intp)])


def merge_pictures(pictures: NDArray[np.float32], weights: NDArray[np.float64]) -> NDArray[np.float32]:
    """One picture (height, width, 3) of several (count, height, width, 3) of the same thing.

    The weighted mean; of three or more, values count less the farther they are from the median (Huber's way).
    """
    if len(pictures) == 1:
        return np.asarray(pictures[0])
    counted = weights.astype(np.float32)[:, None, None, None]
    if len(pictures) > 2:
        away = np.abs(pictures - np.median(pictures, axis=0)).mean(axis=3, keepdims=True)
        counted = counted / (1 + (away / np.float32(_AGREE)) ** 2)
    return np.asarray((pictures * counted).sum(axis=0) / counted.sum(axis=0), np.float32)


def _limit(heights: NDArray[np.float64], most: int) -> float:
    """Distance up to which must be merged so that no more groups than these are left."""
    merges = len(heights) + 1 - most
    return float(heights[merges - 1]) + 1e-12 if merges > 0 else 0.0
