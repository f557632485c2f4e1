"""Which pattern each plateau shows: matched to the known sequence by how bright and from which side the face is lit.

The light that a cell of the face gets under a pattern, as a share of that under white, does not depend on the skin:
only on which of the patches light it, and these shares are predicted for a head of average shape. Plateaus come in the
order of the sequence, so a dynamic program finds the best assignment; one that shows no pattern belongs to none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.errors import CaptureError
from relit_camera.capture.desk.patterns.plateaus import Plateau
from relit_camera.capture.desk.person.patch_light import Patches


@dataclass(frozen=True)
class MatchingTunables:
    """Constants of the matching, chosen on simulated recordings (docs/desk.md).

    Attributes:
        min_contrast: white over black on the face, below which no pattern can be told from another.
        unknown_cost: difference of shares from which a plateau shows no pattern at all.
        skipped_cost: of a pattern that no plateau shows.
        max_cost: mean difference of an assignment above which the patterns were not seen.
        turned_ratio: cost of the best assignment relative to that for a turned screen, above which it is turned.
    """

    min_contrast: float = 1.15
    unknown_cost: float = 0.25
    skipped_cost: float = 0.02
    max_cost: float = 0.16
    turned_ratio: float = 1.25


TUNABLES = MatchingTunables()

MAX_GAIN, GAIN_COST = 1.5, 0.1
"""Most by which the light of all patches may be off from the prediction, and what each unit of its logarithm costs."""
_TURNED = {
    "mirrored: what is left on the screen lights the face from the right": (-1, 1),
    "upside down": (1, -1),
    "turned by half": (-1, -1),
}


@dataclass(frozen=True)
class FaceCells:
    """Cells of the frame's grid that lie on the face.

    Attributes:
        inside: (rows, columns) mask.
        points_cm, normals: (cells inside, 3) of an average head.
    """

    inside: NDArray[np.bool_]
    points_cm: Float32Array
    normals: Float32Array


@dataclass(frozen=True)
class MatchedPlateaus:
    """The patterns of the plateaus.

    Attributes:
        patterns: (plateaus,) index in the sequence of what each shows; -1 for nothing.
        cost: mean difference of shares under patterns that are neither black nor white.
    """

    patterns: NDArray[np.intp]
    cost: float


def match_patterns(plateaus: list[Plateau], lights: Float64Array, face: FaceCells, patches: Patches) -> MatchedPlateaus:
    """The pattern of each plateau.

    Args:
        plateaus: in the order of filming.
        lights: (patterns, patches) of the sequence, in its order.
        face: where the face is.
        patches: before the face.

    Raises:
        CaptureError: white does not brighten the face, the patterns are not seen, or the screen is turned.
    """
    seen = np.stack([plateau.cells[face.inside] for plateau in plateaus])
    brightness = seen.mean(axis=1)
    white, black = seen[brightness.argmax()], seen[brightness.argmin()]
    contrast = float(brightness.max() / max(brightness.min(), 1e-6))
    if contrast < TUNABLES.min_contrast:
        what = f"the patterns are not seen: under white the face is only {contrast:.2f} times as bright as under black"
        raise CaptureError(what, "darken the room, raise the screen's brightness, come nearer")
    shares = (seen - black) / np.maximum(white - black, 1e-3 * white.max())
    shares = np.clip(shares, -0.2, 1.3)
    mixed = lights.max(axis=1) > lights.min(axis=1) + 1e-6
    best = _assign(shares, predicted_shares(lights, face, patches, (1, 1)), mixed)
    costs = {
        name: _assign(shares, predicted_shares(lights, face, patches, turned), mixed).cost
        for name, turned in _TURNED.items()
    }
    likeliest = min(costs, key=lambda name: costs[name])
    if best.cost > TUNABLES.turned_ratio * costs[likeliest]:
        cure = "switch off mirroring and rotation of webcam and screen"
        raise CaptureError(f"the patterns are {likeliest}", cure)
    if best.cost > TUNABLES.max_cost:
        apart = f"differs from them by {best.cost:.0%}" if np.isfinite(best.cost) else "is like none of them"
        what = f"the patterns are not seen: the light on the face {apart}"
        raise CaptureError(what, "darken the room, sit upright before the middle of the screen, and keep still")
    return best


def predicted_shares(lights: Float64Array, face: FaceCells, patches: Patches, turned: tuple[int, int]) -> Float32Array:
    """Light of each pattern on each cell as a share of that of white: (patterns, cells)."""
    centers = patches.centers_cm.copy()
    middle = centers.mean(axis=0)
    centers[:, :2] = middle[:2] + (centers[:, :2] - middle[:2]) * turned
    if turned != (1, 1):
        patches = Patches(centers, patches.size_cm)
    light = np.stack(
        [
            np.maximum(np.einsum("nc,nc->n", face.normals, patches.irradiance(face.points_cm, patch)), 0)
            for patch in range(len(centers))
        ]
    )
    return np.asarray(lights @ light / np.maximum(light.sum(axis=0), 1e-12), np.float32)


def _differences(shares: Float32Array, predicted: Float32Array) -> Float32Array:
    """Mean difference (plateaus, patterns) of shares; as a whole they may be brighter or darker, at a lower cost.

    A webcam that exposes by itself changes all of them: it is to be told so, not that patterns are missing.
    """
    found, expected = shares.mean(axis=1)[:, None], predicted.mean(axis=1)[None]
    gain = np.clip(expected / np.maximum(found, 1e-3), 1 / MAX_GAIN, MAX_GAIN)
    apart = np.abs(shares[:, None] * gain[..., None] - predicted[None]).mean(axis=2)
    return np.asarray(apart + GAIN_COST * np.abs(np.log(gain)), np.float32)


def _assign(shares: Float32Array, predicted: Float32Array, mixed: NDArray[np.bool_]) -> MatchedPlateaus:
    """The best assignment of plateaus (plateaus, cells) to patterns (patterns, cells) in their order.

    Its cost is that of the patterns that are `mixed` (patterns,), neither black nor white.
    """
    difference = _differences(shares, predicted)
    count, patterns = difference.shape
    # State k: the last assigned pattern is k - 1. Total cost of each state; a later plateau may repeat its pattern,
    # since a movement splits plateaus.
    total = np.full(patterns + 1, np.inf)
    total[0] = 0
    came_from = np.zeros((count, patterns + 1), np.intp)
    for plateau in range(count):
        reached = total + TUNABLES.unknown_cost
        came_from[plateau] = -1
        cheapest, before = np.inf, 0
        for state in range(1, patterns + 1):
            cheapest += TUNABLES.skipped_cost
            if total[state - 1] < cheapest:
                cheapest, before = float(total[state - 1]), state - 1
            repeated = bool(total[state] < cheapest)
            taken = min(float(total[state]), cheapest) + float(difference[plateau, state - 1])
            if taken <= reached[state]:
                reached[state], came_from[plateau, state] = taken, state if repeated else before
        total = reached
    total = total + TUNABLES.skipped_cost * np.arange(patterns, -1, -1)
    state = int(total.argmin())
    found = np.full(count, -1, np.intp)
    for plateau in range(count - 1, -1, -1):
        before = came_from[plateau, state]
        if before >= 0:
            found[plateau], state = state - 1, int(before)
    telling = (found < 0) | mixed[found]
    costs = np.where(found < 0, TUNABLES.unknown_cost, difference[np.arange(count), found])
    # What matches nothing counts, so that an assignment cannot be good by leaving most out.
    return MatchedPlateaus(found, float(costs[telling].mean()) if telling.any() else np.inf)
