"""A synthetic film of a textured face with given motion, under a blinking light that moves around."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.capture.film.face_circle import FaceCircle

SIZE = (240, 280)
CIRCLE = FaceCircle(112.0, 150.0, 70.0)


@dataclass(frozen=True)
class Move:
    """Position of the face: turned counter-clockwise about the picture's center, then shifted by pixels."""

    degrees: float = 0.0
    x: float = 0.0
    y: float = 0.0


def texture(seed: int = 0, finest: float = 2.0) -> np.ndarray:
    """Reflectance (height, width) of a disc with features of several sizes, 0 outside."""
    rng = np.random.default_rng(seed)
    layers = [cv2.GaussianBlur(rng.normal(size=SIZE[::-1]), (0, 0), finest * scale) for scale in (1, 2, 4, 8)]
    mixed = sum(layer / layer.std() for layer in layers) / 4
    x, y = np.arange(SIZE[0]) + 0.5, (np.arange(SIZE[1]) + 0.5)[:, None]
    inside = np.clip(1.15 * CIRCLE.radius - np.hypot(x - CIRCLE.x, y - CIRCLE.y), 0, 1)
    return ((0.5 + 0.15 * mixed).clip(0.08, 1) * inside).astype(np.float32)


def moved(picture: np.ndarray, move: Move) -> np.ndarray:
    """The picture after a move, cubic; worked out in the complex plane, whose imaginary axis goes up."""
    height, width = picture.shape
    column, row = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    here = (column - move.x) - 1j * (row - move.y)
    before = here * np.exp(-1j * np.radians(move.degrees))
    x, y = before.real + width / 2 - 0.5, -before.imag + height / 2 - 0.5
    return cv2.remap(picture, x.astype(np.float32), y.astype(np.float32), cv2.INTER_CUBIC)


def shading(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    """Light (height, width) on a ball about the face's circle, from one direction."""
    x = (np.arange(SIZE[0]) + 0.5 - CIRCLE.x) / (1.3 * CIRCLE.radius)
    y = (CIRCLE.y - np.arange(SIZE[1])[:, None] - 0.5) / (1.3 * CIRCLE.radius)
    z = np.sqrt(np.clip(1 - x * x - y * y, 0.05, 1))
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    light = np.sin(azimuth) * np.cos(elevation) * x + np.sin(elevation) * y + np.cos(azimuth) * np.cos(elevation) * z
    return np.clip(light, 0, None).astype(np.float32)


def film_moving(path: Path, moves: list[Move], faces: list[np.ndarray] | None = None) -> Path:
    """Write a video: three frames lit, three not, by a light that goes from left to right and up and down.

    The frames have an automatic exposure that varies by up to a fifth, and noise. Each may show another face.
    """
    rng = np.random.default_rng(0)
    faces = faces or [texture()] * len(moves)
    backdrop = np.float32(0.03)
    with VideoWriter(path, SIZE, 30.0, crf=8) as video:
        for index, (move, face) in enumerate(zip(moves, faces, strict=True)):
            done = index / max(len(moves) - 1, 1)
            lit = shading(-60 + 120 * done, 30 * np.sin(9 * done)) if index % 6 < 3 else 0
            light = moved(face, move) * (0.08 + 0.7 * lit) + backdrop
            light = light * (1 + 0.2 * np.sin(index / 7)) + rng.normal(0, 0.002, light.shape)
            codes = 255 * np.clip(light, 0, 1) ** (1 / 2.2)
            video.write(np.repeat(codes.astype(np.uint8)[..., None], 3, axis=2))
    return path


def wandering(frames: int, seed: int = 1, pixels: float = 3.0, degrees: float = 0.8) -> list[Move]:
    """Slow motion like that of a head that tries to rest."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames)[:, None] / 30
    rates, phases = rng.uniform(0.5, 2.5, (3, 1, 3)), rng.uniform(0, 6.3, (3, 1, 3))
    values = sum(np.sin(rate * time + phase) for rate, phase in zip(rates, phases, strict=True)) / np.sqrt(1.5)
    values -= values.mean(axis=0)
    return [Move(degrees * a, pixels * x, pixels * y) for a, x, y in values.tolist()]
