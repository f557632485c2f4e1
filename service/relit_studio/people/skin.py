"""A person's skin: the photographed albedo in their colour, with moles and freckles of their own."""

from __future__ import annotations

import cv2
import numpy as np

from relit_camera.space.colour import linear_from_uint8, uint8_from_linear
from relit_camera.space.images import DisplayImage
from relit_studio.people.geometry import Floats, smoothstep
from relit_studio.people.scan_pictures import lips_mask, scalp_mask
from relit_studio.people.traits import Traits

SIDE = 2048
_MEAN_ALBEDO = (0.61, 0.355, 0.265)
"""Linear mean of the photographed face."""
_FACE = slice(600, 1450)
"""Rows and columns of the map that hold the face."""
_MELANIN_SPOT = np.array([0.35, 0.6, 0.8])
"""What a spot takes of each channel."""


def skin_picture(photo: DisplayImage, traits: Traits) -> DisplayImage:
    """Albedo (2048, 2048, 3), sRGB, in the scan's texture space; `photo` is the cleaned (1024, 1024, 3)."""
    large = cv2.resize(linear_from_uint8(photo), (SIDE, SIDE), interpolation=cv2.INTER_CUBIC).clip(1e-3, 1)
    albedo = np.array(traits.skin) * (large / np.array(_MEAN_ALBEDO)) ** traits.contrast
    scalp = 0.8 * scalp_mask(SIDE)[..., None]
    albedo = albedo * (1 - scalp) + np.array(traits.skin) * 0.82 * scalp
    lips = lips_mask(SIDE)[..., None]
    albedo = albedo * (1 - lips + lips * np.array(traits.lips))
    return uint8_from_linear((albedo * (1 - _spots(traits.seed)[..., None] * _MELANIN_SPOT)).astype(np.float32))


def oil(mean: Floats) -> Floats:
    """0..1 (vertices,) where skin is oily, on the mean head: forehead and nose."""
    forehead = smoothstep(mean[:, 1], 6.5, 9) * smoothstep(mean[:, 2], 6, 9)
    nose = np.exp(-((mean - [0, 1.0, 12.5]) ** 2).sum(axis=1) / 3.5)
    return np.asarray(np.maximum(forehead, nose))


def lips(mean: Floats, ring: Floats) -> Floats:
    """0..1 (vertices,) where the lips are: inside their outer edge `ring` (n, 2), seen from the front."""
    edge = ring.astype(np.float32).reshape(-1, 1, 2)
    inside = np.array([cv2.pointPolygonTest(edge, (float(x), float(y)), True) for x, y in mean[:, :2]])
    return smoothstep(inside, -0.08, 0.12) * (mean[:, 2] > 8.5)


def _spots(seed: int) -> Floats:
    """0..1 (2048, 2048): many faint freckles, a few moles, and of these one or two that are raised dark."""
    rng = np.random.default_rng(seed)
    canvas = np.zeros((SIDE, SIDE), np.float32)
    freckles, moles = int(rng.integers(80, 400)), int(rng.integers(3, 12))
    for radius, depth, count in (((1, 3), (0.05, 0.25), freckles), ((2, 5), (0.35, 0.8), moles)):
        for _ in range(count):
            middle = tuple(int(place) for place in rng.integers(_FACE.start, _FACE.stop, 2))
            cv2.circle(canvas, middle, int(rng.integers(*radius)), float(rng.uniform(*depth)), -1, cv2.LINE_AA)
    return np.asarray(cv2.GaussianBlur(canvas, (0, 0), 1.2), np.float64)
