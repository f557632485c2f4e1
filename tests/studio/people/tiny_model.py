"""A face model small enough to compute with in a test: a bulging patch that varies in a few smooth ways."""

from __future__ import annotations

import numpy as np

from relit_studio.people.face.face_model import IDENTITIES, FaceModel

SIDE = 21


def tiny_model() -> FaceModel:
    """All skin; landmarks are spread over it; identities are waves, weaker with their order."""
    across = np.linspace(-8, 8, SIDE)
    x, y = np.meshgrid(across, across)
    z = 11 - 0.06 * (x**2 + y**2) + 2.5 * np.exp(-((x**2 + y**2) / 4)) + np.exp(-((x - 4) ** 2 + (y - 3) ** 2))
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    corner = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], axis=-1).reshape(-1, 4)
    rng = np.random.default_rng(0)
    waves = []
    for order in range(IDENTITIES):
        frequency, phase = rng.uniform(0.1, 0.5, 2), rng.uniform(0, 6.28, 2)
        wave = np.sin(frequency[0] * x + phase[0]) * np.cos(frequency[1] * y + phase[1])
        direction = rng.normal(size=3)
        waves.append((0.3 / (1 + order)) * wave.reshape(-1, 1) * direction)
    blink = 0.4 * np.exp(-((x - 3) ** 2 + (y - 3) ** 2)).reshape(-1, 1) * np.array([0, -1.0, 0])
    return FaceModel(
        vertices=vertices,
        faces=faces.astype(np.int32),
        face_uv=faces.astype(np.int32),
        uv=np.zeros((len(vertices), 2), np.float32),
        face_part=np.zeros(len(faces), np.int8),
        face_material=np.zeros(len(faces), np.int8),
        vertex_part=np.zeros(len(vertices), np.int8),
        identities=np.array(waves, np.float16),
        expressions=np.array([blink, blink * [-1, 1, 1]], np.float16),
        names=("eyeBlink_L", "eyeBlink_R"),
        landmarks68=np.linspace(22, len(vertices) - 23, 68).astype(np.int32),
    )
