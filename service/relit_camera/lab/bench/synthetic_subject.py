"""Synthetic subject for benchmarks: a colored, bumpy, glossy head under 64 lights."""

from __future__ import annotations

import numpy as np

from relit_camera.base.images.image_types import Points
from relit_camera.base.rotations import Rotation
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.capture.subject_builder import build_subject
from relit_camera.face.head_pose import HeadPose, guess_focal, project
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.light.directions import fibonacci_directions
from relit_camera.subject.subject import Subject

LIGHT_COUNT = 64
LANDMARK_SCHEME = "mesh478"


def synthetic_subject(width: int = 150, height: int = 200) -> Subject:
    """An RGB subject of exactly 64 captured lights over the sphere, by default of the thesis's 150 x 200 pixels."""
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    rng = np.random.default_rng(0)
    amplitude, phase = rng.uniform(0.005, 0.02, 24), rng.uniform(0, 6, 24)
    across, down = rng.uniform(-25, 25, (2, 24))
    bumps = np.cos(x[..., None] * across + y[..., None] * down + phase) @ amplitude
    depth = np.sqrt(np.maximum(1.6 - x * x - y * y, 0.05)) + bumps
    slope_y, slope_x = np.gradient(depth, 2 / height, 2 / width)
    normal = np.dstack([-slope_x, slope_y, np.ones_like(depth)])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    albedo = np.array([0.62, 0.42, 0.33]) * (0.8 + 0.4 * rng.random((height, width, 1)))
    directions = fibonacci_directions(LIGHT_COUNT)
    pictures = np.empty((LIGHT_COUNT, height, width, 3), dtype=np.float32)
    for index, light in enumerate(directions):
        half = (light + [0, 0, 1]) / max(float(np.linalg.norm(light + [0, 0, 1])), 1e-6)
        facing = np.maximum(normal @ light, 0)[..., None]
        gloss = 0.3 * (facing > 0) * np.maximum(normal @ half, 0)[..., None] ** 40
        pictures[index] = albedo * (facing + 0.02) + gloss
    matte = np.ones((height, width), dtype=np.float32)
    return build_subject(
        OlatSamples(pictures, directions, matte),
        "barycentric",
        "generated",
        landmarks={LANDMARK_SCHEME: _mean_face(width, height)},
        with_geometry=False,
    )


def _mean_face(width: int, height: int) -> Points:
    """Landmarks of a mean face in the picture's middle that looks into the camera, for the live pipeline."""
    pose = HeadPose(Rotation.identity(), np.array([0.0, 0.0, -32.0]), guess_focal((width, height)))
    return project(landmark_scheme(LANDMARK_SCHEME).canonical.copy(), pose, (width, height))
