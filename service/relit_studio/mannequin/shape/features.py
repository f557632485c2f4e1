"""Eyeballs, teeth and ears."""

from __future__ import annotations

import numpy as np

from relit_camera.base.array_types import Float64Array
from relit_camera.face.landmarks.landmark_schemes import EyeLandmarks
from relit_studio.mannequin.shape.head import EYE_RADIUS
from relit_studio.mannequin.shape.part import EYE, SKIN, TOOTH, Part, grid_part
from relit_studio.mannequin.shape.texture_atlas import IRIS_SHARE, SKIN_TONE, eye_paint_position

_CORNEA_BULGE = 0.06


def eyeball(eye: EyeLandmarks, name: str) -> Part:
    """An eyeball about its own center, looking along +Z."""
    polar, around = np.radians(np.linspace(0, 100, 27)), np.linspace(0, 2 * np.pi, 36, endpoint=False)
    directions = np.stack(
        [
            np.sin(polar)[:, None] * np.sin(around),
            np.sin(polar)[:, None] * np.cos(around),
            np.broadcast_to(np.cos(polar)[:, None], (polar.size, around.size)),
        ],
        axis=-1,
    )
    inside = np.clip(1 - (np.hypot(directions[..., 0], directions[..., 1]) / (1.1 * IRIS_SHARE)) ** 2, 0, None)
    vertices = directions * (EYE_RADIUS + _CORNEA_BULGE * inside)[..., None]
    paint = eye_paint_position(directions)
    return grid_part(name, vertices, np.ones(3), EYE, closed=True, mirrored=True, paint=paint, caster_step=3)


def iris_points() -> Float64Array:
    """Iris landmarks (5, 3) on the eyeball about its center: middle, picture right, top, picture left, bottom."""
    ring = np.array([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]]) * IRIS_SHARE
    depth = np.sqrt(1 - (ring**2).sum(axis=1, keepdims=True))
    points = EYE_RADIUS * np.concatenate([ring, depth], axis=1)
    points[0, 2] += _CORNEA_BULGE
    return points


def teeth(name: str, *, upper: bool) -> Part:
    """A row of teeth on an arch, in head axes with the jaw closed."""
    arch = np.radians(np.linspace(-72, 72, 97))
    rows = np.linspace(0, 1, 9)
    gap = np.abs(np.sin(arch * (10.5 if upper else 13))) ** 0.35
    top, bottom, front = (-3.3, -4.36, 4.78) if upper else (-4.5, -5.3, 4.5)
    height = top + (bottom - top) * rows[:, None] * np.ones_like(arch)
    edge = rows if upper else 1 - rows
    height = height + (0.07 if upper else -0.07) * (1 - gap) * edge[:, None]
    # Teeth stand out between their gaps, and lean back toward their edge.
    out = 0.10 * gap * np.sin(np.pi * np.clip(edge, 0.15, 0.85))[:, None] - 0.1 * edge[:, None]
    width, depth = 2.45 + out, 2.3 + out
    vertices = np.stack([width * np.sin(arch), height, front - 2.3 + depth * np.cos(arch)], axis=-1)
    ivory, gum = np.array([0.68, 0.63, 0.55]), np.array([0.42, 0.17, 0.15])
    fraction = np.clip((edge - 0.28) / 0.12, 0, 1)[:, None, None]
    color = (gum + (ivory - gum) * fraction) * (0.62 + 0.38 * gap)[None, :, None]
    color *= np.clip(np.cos(arch) * 1.5, 0.1, 1)[None, :, None]
    return grid_part(name, vertices, color, TOOTH, caster_step=4)


def ear(name: str, side: int) -> Part:
    """An ear in head axes; `side` is 1 for the one at the picture's right, -1 for the other."""
    around = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    front, back = np.linspace(0.02, 1, 22), np.array([1.06, 1.0, 0.8, 0.5])
    upward = np.cos(around)
    lobe = np.clip(-upward, 0, 1)
    forward = np.clip(np.sin(around), 0, 1)
    radius_u = 1.75 * (1 - 0.32 * lobe)
    r = front[:, None]
    rim = 0.42 * np.exp(-(((r - 0.88) / 0.10) ** 2)) * (1 - 0.75 * lobe) * (1 - 0.45 * forward)
    fold = 0.34 * np.exp(-(((r - 0.56) / 0.13) ** 2)) * (1 - 0.9 * forward)
    bowl = -0.55 * np.exp(-((r / 0.42) ** 2))
    tragus = 0.4 * np.exp(-(((r - 0.5) / 0.16) ** 2)) * np.clip(np.cos(around - np.pi / 2 - 0.3), 0, 1) ** 6
    height = np.concatenate([rim + fold + bowl + tragus, np.repeat([[-0.18], [-0.5], [-0.8], [-0.9]], 48, axis=1)])
    r = np.concatenate([front, back])[:, None]
    u, v = r * np.sin(around) * radius_u, r * upward * 3.0
    flare, lean = np.radians(32), np.radians(-14)
    u, v = u * np.cos(lean) - v * np.sin(lean), u * np.sin(lean) + v * np.cos(lean)
    outward = np.array([np.cos(flare), 0, np.sin(flare)])
    ahead = np.array([-np.sin(flare), 0, np.cos(flare)])
    vertices = np.array([7.95, 0.3, -3.6]) + u[..., None] * ahead + height[..., None] * outward
    vertices[..., 1] += v
    redness = np.clip(0.5 + height, 0.25, 1)[..., None]
    color = SKIN_TONE * (1 - (1 - redness) * [0.3, 0.45, 0.45]) * [1, 0.93, 0.93]
    return grid_part(name, vertices * [side, 1, 1], color, SKIN, closed=True, mirrored=side < 0, caster_step=3)
