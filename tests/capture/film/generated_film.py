"""A synthetic film of a round head on shoulders, one or two mirror balls, and a blinking lamp that moves around."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.video.video_writer import VideoWriter
from tests.capture.film.ball.mirror_scene import MirrorScene, unit

SIZE = (240, 300)
FOCAL_PX = 300.0
PX_PER_CM = 52 / 9.5
HEAD = (105.0, 150.0)
DEPTH_CM = FOCAL_PX / PX_PER_CM
FINE = 3
PERIOD = 6.08
"""Frames from flash to flash."""
WALL = np.array([0.12, 0.11, 0.1])
SKIN = np.array([0.55, 0.4, 0.3])


def head_cm() -> np.ndarray:
    """The middle of the face's surface, camera axes."""
    return np.array([(HEAD[0] - SIZE[0] / 2) / PX_PER_CM, (SIZE[1] / 2 - HEAD[1]) / PX_PER_CM, -DEPTH_CM])


def with_ball(across_px: float, up_px: float, behind_cm: float) -> MirrorScene:
    """A camera and a ball at an offset from the picture's middle, `behind_cm` farther away than the head."""
    at = np.array([across_px / PX_PER_CM, up_px / PX_PER_CM, -DEPTH_CM])
    return MirrorScene(SIZE, FOCAL_PX, at * (1 + behind_cm / DEPTH_CM), 30 / PX_PER_CM, lamp_radius_cm=4.0)


@dataclass(frozen=True, eq=False)
class Film:
    """The lamp is on for three frames, off for three.

    Attributes:
        frames: how many.
        azimuth, elevation: degrees through which the lamp goes from left to right, and up and down.
        hunting: how much exposure and balance swing (logarithm).
        distance_cm: from the lamp to the head.
        sway: frames in which the hand moves to and fro by about a radian.
        enhanced: strength of a local tone mapping by the camera.
        scene: the camera, the ball, and the room that it shows.
        second: the same with another ball, if there are two.
    """

    frames: int = 240
    azimuth: tuple[float, float] = (-70.0, 70.0)
    elevation: tuple[float, float] = (-15.0, 60.0)
    hunting: float = 0.15
    distance_cm: float = 100.0
    sway: float = 2.3
    enhanced: float = 0.0
    scene: MirrorScene = field(default_factory=lambda: with_ball(70, 80, 0))
    second: MirrorScene | None = None

    @property
    def scenes(self) -> tuple[MirrorScene, ...]:
        """The scene of each ball."""
        return (self.scene,) if self.second is None else (self.scene, self.second)

    def lamp_cm(self, index: int) -> np.ndarray:
        """Position (3,) of the lamp from the head's middle, camera axes, in a frame."""
        done = index / max(self.frames - 1, 1)
        azimuth = np.radians(np.interp(done, (0, 1), self.azimuth))
        low, high = np.radians(self.elevation)
        elevation = low + (high - low) * (0.5 - 0.5 * np.cos(2 * np.pi * 2.5 * done))
        toward = [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
        return self.distance_cm * self.strength(index) ** -0.5 * np.array(toward)

    def strength(self, index: int) -> float:
        """Light of the lamp at the head in a frame, relative to that at the usual distance."""
        return float(np.exp(0.25 * np.sin(index / self.sway)))

    def gain(self, index: int) -> np.ndarray:
        """Gains (3,) of the camera in a frame."""
        swing = self.hunting * np.sin(index / 11)
        return np.exp([swing, 0.8 * swing, 0.5 * swing])

    def lit(self, index: int) -> float:
        """Exposure fraction of a frame, whose exposure is half of the time to the next."""
        start = (index + 0.3) % PERIOD
        return float(np.clip((PERIOD / 2 - start) / 0.5, 0, 1) + np.clip((start + 0.5 - PERIOD) / 0.5, 0, 1))

    @cached_property
    def surface(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Normals and points (cm from the head's middle) (height, width, 3), and the head and shoulders' mask."""
        x, y = np.meshgrid(np.arange(SIZE[0]) + 0.5, np.arange(SIZE[1]) + 0.5)
        u, v = (x - HEAD[0]) / PX_PER_CM, (HEAD[1] - y) / PX_PER_CM
        head, body = np.hypot(u, v) < 9.5, (u / 18) ** 2 + ((v + 25) / 17) ** 2 < 1
        # The head's middle is that of its visible half's surface.
        z = np.where(head, np.sqrt(np.maximum(9.5**2 - u**2 - v**2, 0)) - 6.3, -6.3)
        deep = 12 * np.sqrt(np.maximum(1 - (u / 18) ** 2 - ((v + 25) / 17) ** 2, 0))
        z = np.where(head, z, deep - 12)
        of_head = np.stack([u, v, np.sqrt(np.maximum(9.5**2 - u**2 - v**2, 1e-3))], -1)
        of_body = np.stack([u / 18**2, (v + 25) / 17**2, np.maximum(deep, 0.05) / 12**2], -1)
        normals = unit(np.where(head[..., None], of_head, of_body))
        return normals, np.stack([u, v, z], -1), head | body

    @cached_property
    def reflectance(self) -> np.ndarray:
        """(height, width, 3) linear, 0 outside of the person."""
        rng = np.random.default_rng(3)
        layers = [cv2.GaussianBlur(rng.normal(size=SIZE[::-1]), (0, 0), 1.5 * scale) for scale in (1, 2, 4)]
        mixed = sum(layer / layer.std() for layer in layers) / 3
        return (SKIN * (1 + 0.25 * mixed[..., None])).clip(0.05, 1) * self.surface[2][..., None]

    def flash(self, index: int, near: bool = True) -> np.ndarray:
        """Light of the flash (height, width, 3); or, with a distant lamp, for unit light at the head's middle."""
        normals, points, _ = self.surface
        lamp = self.lamp_cm(index)
        if not near:
            return self.reflectance * np.maximum(normals @ unit(lamp), 0)[..., None]
        way = lamp - points
        squared = np.sum(way**2, axis=-1)
        cosine = np.maximum(np.sum(normals * way, axis=-1), 0) / np.sqrt(squared)
        # Half as much light 45 degrees off the way to the head.
        beam = np.maximum(way @ unit(lamp), 0) ** 2 / squared
        return self.reflectance * (cosine * beam * self.distance_cm**2 / squared)[..., None]

    @cached_property
    def _mirrors(self) -> list[tuple[MirrorScene, np.ndarray, np.ndarray, np.ndarray]]:
        width, height = SIZE
        place = np.meshgrid((np.arange(width * FINE) + 0.5) / FINE, (np.arange(height * FINE) + 0.5) / FINE)
        made = []
        for scene in self.scenes:
            rays = scene.rays(*place)
            hit, points = scene.hit(rays)
            made.append((scene, hit, points[hit], scene.mirror(rays[hit], points[hit])))
        return made

    @cached_property
    def _room(self) -> tuple[np.ndarray, np.ndarray]:
        """The wall with the balls' mirror images of the room (height, width, 3), and how much of a pixel they are."""
        x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
        wall = WALL * (1 + 0.25 * np.sin(x / 9) * np.sin(y / 13))[..., None]
        fine = np.zeros((2, SIZE[1] * FINE, SIZE[0] * FINE), np.float32)
        for scene, hit, _, mirrored in self._mirrors:
            fine[0, hit] = scene.reflectance * scene.room(mirrored)
            fine[1, hit] = 1
        ball, cover = (cv2.resize(each, SIZE, interpolation=cv2.INTER_AREA) for each in fine)
        return wall * (1 - cover[..., None]) + ball[..., None], cover

    def _glint(self, index: int) -> np.ndarray:
        """The lamp's mirror image in the balls (height, width)."""
        fine = np.zeros((SIZE[1] * FINE, SIZE[0] * FINE), np.float32)
        for scene, hit, points, mirrored in self._mirrors:
            fine[hit] = scene.lamp_seen(points, mirrored, self.lamp_cm(index) + head_cm(), 60.0)
        return cv2.GaussianBlur(cv2.resize(fine, SIZE, interpolation=cv2.INTER_AREA), (0, 0), 0.7)

    def shift(self, index: int) -> tuple[float, float]:
        """Shift x, y of the head in pixels in a frame."""
        return 1.5 * np.sin(index / 17), 1.0 * np.sin(index / 23 + 1)

    def light(self, index: int) -> np.ndarray:
        """The scene (height, width, 3), linear, before the camera's gains."""
        room, cover = self._room
        normals, _, person = self.surface
        lit = self.reflectance * (0.05 + 0.03 * normals[..., 1:2]) + (
            self.lit(index) * self.flash(index) if self.lit(index) else 0
        )
        matrix = np.array([[1, 0, self.shift(index)[0]], [0, 1, self.shift(index)[1]]])
        moved = cv2.warpAffine(np.dstack([lit, person.astype(float)]), matrix, SIZE, flags=cv2.INTER_LINEAR)
        there = moved[..., 3:] * (1 - cover[..., None])
        seen = room * (1 - there) + moved[..., :3] * (1 - cover[..., None])
        return seen + (self.lit(index) * self._glint(index)[..., None] if self.lit(index) else 0)

    def codes(self) -> np.ndarray:
        """All frames, uint8 sRGB (frames, height, width, 3)."""
        rng = np.random.default_rng(0)
        made = []
        for index in range(self.frames):
            light = 0.8 * self.light(index) * self.gain(index)
            if self.enhanced:
                around = cv2.GaussianBlur(light, (0, 0), 25).mean(axis=2, keepdims=True)
                light = light * (0.1 / (around + 0.02)) ** self.enhanced
            light = light + rng.normal(0, 0.002, light.shape)
            made.append(np.round(255 * np.clip(light, 0, 1) ** (1 / 2.2)).astype(np.uint8))
        return np.stack(made)


def write_film(path: Path, codes: np.ndarray) -> Path:
    """A video of these frames, the same on every run; its curve is the exponent 2.2.

    Without loss: what x264 loses depends on chance on processors with AVX-512, unless the width is a multiple of 128.
    """
    size = (codes.shape[2], codes.shape[1])
    with VideoWriter(path, size, 30.0, crf=0) as video:
        for picture in codes:
            video.write(np.ascontiguousarray(picture))
    return path
