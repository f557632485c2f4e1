"""Desk recordings of a person whose field is known: what a webcam would film while a screen shows the patterns.

Each point of the head has its own direction and distance to each part of each patch. The webcam adds noise, 8 bits and
its curve; the person moves, the room has light of its own, and the wall behind gets a little of the screen's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.array_types import Float32Array, Float64Array
from relit_camera.base.images.affine import opencv_affine
from relit_camera.base.images.color import srgb_encode
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_camera.capture.alignment.rigid_transform import RigidTransform
from relit_camera.capture.desk.desk_recording import CameraPlace, DeskRecording, DeskSetup, FacePlace, Screen
from relit_camera.capture.desk.patterns.pattern_sequence import pattern_lights
from relit_camera.capture.desk.person.patch_light import EXTENT_SAMPLES, place_patches
from relit_camera.subject.reflectance_field import ExactField

MONITOR = DeskSetup(screen=Screen(width_cm=58.5, height_cm=34.4), distance_cm=60, camera=CameraPlace(up_cm=18.0))
"""A monitor of 27 inches, the webcam on top."""
LAPTOP = DeskSetup(screen=Screen(width_cm=31, height_cm=19), distance_cm=50, camera=CameraPlace(up_cm=10.5))
"""A laptop of 14 inches, its own webcam."""
SCREENS: Mapping[str, DeskSetup] = {"desk": MONITOR, "laptop": LAPTOP}
"""Screens by the name of their rung."""

_REACH_DEG, _GRID_SIDE = 54.0, 28
_LINES_AT_A_TIME = 49


@dataclass(frozen=True)
class SimulatedPerson:
    """A person whose reflectance field and shape are known.

    Attributes:
        field: their field, which answers any direction.
        depth_px: (height, width) toward the camera, in pixels; NaN or any value outside.
        matte: (height, width) alpha.
        pixels_per_cm: of the field's picture.
        face: center and radius of the face in the field's picture, in pixels.
    """

    field: ExactField
    depth_px: Float32Array
    matte: Mask
    pixels_per_cm: float
    face: tuple[float, float, float]

    @cached_property
    def inside(self) -> NDArray[np.intp]:
        """Row-major indices of the person's pixels."""
        return np.flatnonzero(self.matte.ravel() > 0)

    @cached_property
    def points_cm(self) -> Float32Array:
        """Positions (pixels inside, 3) from the middle of the face, camera axes."""
        row, column = np.divmod(self.inside, self.matte.shape[1])
        x, y, radius = self.face
        across, up = (column + 0.5 - x) / self.pixels_per_cm, (y - row - 0.5) / self.pixels_per_cm
        toward = np.nan_to_num(self.depth_px).ravel()[self.inside] / self.pixels_per_cm
        middle = np.hypot(across, up) < 0.6 * radius / self.pixels_per_cm
        return np.stack([across, up, toward - toward[middle].mean()], axis=1).astype(np.float32)

    @cached_property
    def _frontal_grid(self) -> NDArray[np.float16]:
        """The field at a grid of frontal directions, even in angle: (up, across, pixels inside, 3)."""
        tangents = np.tan(np.radians(np.linspace(-_REACH_DEG, _REACH_DEG, _GRID_SIDE)))
        across, up = np.meshgrid(tangents, tangents)
        directions = np.stack([across, up, np.ones_like(across)], axis=-1).reshape(-1, 3)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        parts = [
            self.field.at(directions[k : k + _LINES_AT_A_TIME], self.inside).astype(np.float16)
            for k in range(0, len(directions), _LINES_AT_A_TIME)
        ]
        return np.concatenate(parts).reshape(_GRID_SIDE, _GRID_SIDE, -1, 3)

    def lit_by_own_directions(self, directions: Float32Array) -> Float32Array:
        """The field (pixels inside, 3), each pixel under its own unit vector (pixels inside, 3), bilinear."""
        step = 2 * _REACH_DEG / (_GRID_SIDE - 1)
        place = np.degrees(np.arctan2(directions[:, :2], directions[:, 2:])) / step + (_GRID_SIDE - 1) / 2
        if place.min() < 0 or place.max() > _GRID_SIDE - 1:
            raise ValueError(f"a patch is more than {_REACH_DEG:g} degrees off")
        lower = np.minimum(place.astype(int), _GRID_SIDE - 2)
        (i, j), (fx, fy) = lower.T, (place - lower).T.astype(np.float32)[..., None]
        pixel, grid = np.arange(len(directions)), self._frontal_grid
        low = grid[j, i, pixel] * (1 - fx) + grid[j, i + 1, pixel] * fx
        high = grid[j + 1, i, pixel] * (1 - fx) + grid[j + 1, i + 1, pixel] * fx
        return np.asarray(low * (1 - fy) + high * fy, np.float32)

    def patch_pictures(self, setup: DeskSetup) -> Float32Array:
        """Pictures (patches, height, width, 3) under each patch alone, in units of its light at 60 cm, head on."""
        patches = place_patches(setup)
        steps = (np.arange(EXTENT_SAMPLES) + 0.5) / EXTENT_SAMPLES - 0.5
        share = np.float32(patches.size_cm[0] * patches.size_cm[1] / EXTENT_SAMPLES**2 / 134.16 * 60.0**2)
        pictures = np.zeros((len(patches.centers_cm), self.matte.size, 3), np.float32)
        for picture, center in zip(pictures, patches.centers_cm, strict=True):
            for across in steps * patches.size_cm[0]:
                for up in steps * patches.size_cm[1]:
                    toward = (center + (across, up, 0)).astype(np.float32) - self.points_cm
                    squared = (toward**2).sum(axis=1)
                    light = share * toward[:, 2] / squared**1.5
                    unit = toward / np.sqrt(squared)[:, None]
                    picture[self.inside] += self.lit_by_own_directions(unit) * light[:, None]
        return pictures.reshape(-1, *self.matte.shape, 3)


@dataclass(frozen=True)
class SimulatedWebcam:
    """The webcam and the evening of a simulated recording.

    Attributes:
        size: width and height of a frame.
        noise: standard deviation in codes of 255 at middle gray, at the exposure for one of fifteen patches.
        motion_mm: standard deviation of the head's place from pattern to pattern, in each axis.
        turn_deg: the same of its roll.
        frames_a_pattern, fade_frames: frames while a pattern stands, and while the next one fades in.
        room: light of the room on the face, relative to one of fifteen patches.
        wall: reflectance of the wall 2 m behind.
        exposure: what the brightest skin reads in linear light, under white.
        seed: of noise and motion.
    """

    size: tuple[int, int] = (640, 480)
    noise: float = 4.0
    motion_mm: float = 1.0
    turn_deg: float = 0.0
    frames_a_pattern: int = 10
    fade_frames: int = 4
    room: float = 0.1
    wall: float = 0.3
    exposure: float = 0.85
    seed: int = 0


def simulate_desk_recording(
    person: SimulatedPerson,
    setup: DeskSetup = MONITOR,
    webcam: SimulatedWebcam | None = None,
    said: DeskSetup | None = None,
    room: LinearImage | None = None,
    room_picture: bool = False,
    patch_pictures: Float32Array | None = None,
) -> DeskRecording:
    """What a webcam films of a person while the screen shows the setup's patterns.

    Args:
        person: who sits there, the middle of the face on the camera's axis.
        setup: what is true.
        webcam: how it is filmed.
        said: the setup that the recording states, where it is not the true one.
        room: (height, width, 3) the person in the room's light, at the size of the field; None for soft light.
        room_picture: whether the webcam takes a picture in the room's light alone, with an exposure of its own.
        patch_pictures: (patches, height, width, 3) of the person under each patch alone, of any unit; None has them
            from the field, whose lights are interpolated.
    """
    webcam = webcam or SimulatedWebcam()
    pictures = person.patch_pictures(setup) if patch_pictures is None else patch_pictures
    lights = pattern_lights(setup.patterns, setup.patches.count, setup.screen.gamma, setup.screen.black)
    frames = SimulatedFrames(person, pictures, lights.astype(np.float32), webcam, room, setup)
    face = frames.face
    stated = (said or setup).model_copy(
        update={"face": FacePlace(x=face[0], y=face[1], radius=face[2]), "pixels_per_cm": frames.pixels_per_cm}
    )
    return DeskRecording(stated, frames, frames.in_room_light() if room_picture else None)


@dataclass(frozen=True)
class SimulatedFrames:
    """The frames of a simulated recording, each made when it is asked for and always the same.

    Attributes:
        person: who sits there.
        pictures: (patches, height, width, 3) of the person under each patch alone.
        lights: (patterns, patches) of the sequence.
        webcam: how it is filmed.
        room: (height, width, 3) the person in the room's light, or None.
        setup: what is true.
        change: applied to each frame at last; for tests of bad recordings.
    """

    person: SimulatedPerson
    pictures: Float32Array
    lights: Float32Array
    webcam: SimulatedWebcam
    room: LinearImage | None
    setup: DeskSetup
    change: Callable[[int, DisplayImage], DisplayImage] = field(default=lambda index, frame: frame)

    @property
    def _frames_a_pattern(self) -> int:
        return self.webcam.frames_a_pattern + self.webcam.fade_frames

    @property
    def pixels_per_cm(self) -> float:
        """Of a frame: the frame is 60 cm wide at 60 cm, as with most webcams."""
        return self.webcam.size[0] / self.setup.distance_cm

    @property
    def _zoom(self) -> float:
        return self.pixels_per_cm / self.person.pixels_per_cm

    @property
    def face(self) -> tuple[float, float, float]:
        """Center and radius of the face in a frame."""
        return self.webcam.size[0] / 2, self.webcam.size[1] / 2, self.person.face[2] * self._zoom

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.lights) * self._frames_a_pattern

    def pattern(self, index: int) -> int | None:
        """The pattern of a frame; None while it fades in."""
        pattern, step = divmod(index, self._frames_a_pattern)
        return pattern if step >= self.webcam.fade_frames else None

    @cached_property
    def _places(self) -> Float64Array:
        """Rotation and shift (patterns, 3) of the head in degrees and pixels of a frame."""
        random = np.random.default_rng(self.webcam.seed).normal(size=(len(self.lights), 3))
        shift = self.webcam.motion_mm / 10 * self.pixels_per_cm
        return np.asarray(random * (self.webcam.turn_deg, shift, shift))

    @cached_property
    def _room(self) -> LinearImage:
        """The room's picture (height, width, 3) of the person, in the unit of the patches' pictures."""
        soft = self.pictures.mean(axis=0) if self.room is None else self.room
        inside = self.person.matte > 0.5
        unit = np.percentile(self.pictures[len(self.pictures) // 2][inside], 99.5)
        return np.asarray(self.webcam.room * unit / max(np.percentile(soft[inside], 99.5), 1e-9) * soft, np.float32)

    @cached_property
    def _gain(self) -> float:
        white = self.pictures.sum(axis=0) + self._room
        return self.webcam.exposure / float(np.percentile(white[self.person.matte > 0.5], 99.5))

    @cached_property
    def _wall_light(self) -> Float32Array:
        """Light (patches + 1,) on a wall 2 m behind: a ninth of each patch's, and the room's as the person has it."""
        lit = np.percentile(self.pictures[:, self.person.matte > 0.5], 95, axis=(1, 2)) / 9
        return np.append(lit, 2 * np.percentile(self._room[self.person.matte > 0.5], 90)).astype(np.float32)

    def linear(self, weights: Float32Array, place: RigidTransform) -> LinearImage:
        """The noiseless frame (height, width, 3) under patches of these weights, exposed."""
        face_x, face_y, _ = self.person.face
        matrix = np.array([[self._zoom, 0, -self._zoom * face_x], [0, self._zoom, -self._zoom * face_y]])
        matrix[:, 2] += np.array(self.webcam.size) / 2
        turned = place.matrix(self.webcam.size)
        whole = turned[:, :2] @ matrix
        whole[:, 2] += turned[:, 2]
        lit = np.tensordot(weights, self.pictures, axes=1) + self._room
        both = np.concatenate([lit, self.person.matte[..., None]], axis=2).astype(np.float32)
        # Bicubic: bilinear interpolation would blur each pattern differently, by where between pixels the head is.
        frame = cv2.warpAffine(both, opencv_affine(whole), self.webcam.size, flags=cv2.INTER_CUBIC)
        wall = self.webcam.wall * (self._wall_light[-1] + float(weights @ self._wall_light[:-1]))
        return np.asarray((frame[..., :3] + (1 - frame[..., 3:]) * np.float32(wall)) * self._gain, np.float32)

    def __getitem__(self, index: int, /) -> DisplayImage:
        """The frame."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        pattern, step = divmod(index, self._frames_a_pattern)
        part = min(1.0, (step + 1) / (self.webcam.fade_frames + 1))
        before = max(pattern - 1, 0)
        weights = (1 - part) * self.lights[before] + part * self.lights[pattern]
        moved = (1 - part) * self._places[before] + part * self._places[pattern]
        frame = self.linear(weights.astype(np.float32), RigidTransform(*moved.tolist()))
        random = np.random.default_rng([self.webcam.seed, index])
        # Shot noise and read noise, together `noise` codes at middle gray.
        unit = (self.webcam.noise / 274) ** 2 / (0.216 + 0.05) * self._gain_over_single_patch
        variance = unit * (frame + 0.05 * self._gain_over_single_patch)
        frame += random.standard_normal(frame.shape, np.float32) * np.sqrt(np.maximum(variance, 0))
        return self.change(index, np.rint(srgb_encode(frame) * 255).astype(np.uint8))

    def in_room_light(self) -> DisplayImage:
        """The person before the black screen, in the middle of the places where their head will be."""
        frame = self.linear(np.zeros(self.lights.shape[1], np.float32), RigidTransform())
        frame *= self.webcam.exposure / max(float(np.percentile(frame, 99.5)), 1e-9)
        noise = np.random.default_rng([self.webcam.seed, len(self)]).standard_normal(frame.shape, np.float32)
        codes = srgb_encode(np.maximum(frame, 0)) * 255 + self.webcam.noise * noise
        return np.asarray(np.clip(np.rint(codes), 0, 255), np.uint8)

    @cached_property
    def _gain_over_single_patch(self) -> float:
        """Exposure over that for one patch, in which the noise is given."""
        middle = self.pictures[len(self.pictures) // 2]
        single = 0.8 / float(np.percentile(middle[self.person.matte > 0.5], 99.5))
        return self._gain / single
