"""One plug-in of each kind, written against `relit_camera.plugins` alone."""

from __future__ import annotations

import time
from typing import ClassVar

import numpy as np

from relit_camera.plugins import (
    DisplayImage,
    FaceMotion,
    FaceState,
    FaceStatus,
    FactoredField,
    Frame,
    InputError,
    OlatSamples,
    ReenactorContext,
    ReflectanceField,
    RelighterOptions,
    RenderQuality,
    SinkInfo,
    SinkOptions,
    SourceInfo,
    SourceOptions,
    SourceState,
    Subject,
    TrackerOptions,
    WarpedLayer,
    WarpTask,
    display_from_linear,
    factored_field,
    fit_pose,
    landmark_scheme,
    weighted_light,
)


class CentralFace:
    """A tracker that finds a face in the middle of every frame; the argument is its width in pixels."""

    name, scheme = "example", "mesh478"

    def __init__(self, options: TrackerOptions) -> None:
        self.width_px = float(options.argument or 100)

    def track(self, frame: Frame) -> FaceState:
        scheme = landmark_scheme(self.scheme)
        flat = scheme.canonical[:, :2] * [1, -1] * self.width_px / np.ptp(scheme.canonical[:, 0])
        landmarks = (flat + np.array(frame.size) / 2).astype(np.float32)
        pose = fit_pose(landmarks, scheme, frame.size)
        eyes, mouth = scheme.eyes_opening(landmarks), scheme.mouth_opening(landmarks)
        return FaceState(FaceStatus.FOUND, 1.0, self.scheme, landmarks, pose, eyes, mouth)

    def reset(self) -> None:
        """Nothing is kept between frames."""


class RaisingFace:
    """A tracker with a fault: it cannot be made; with the argument `later`, the fault shows with the first frame."""

    name, scheme = "raising", "mesh478"

    def __init__(self, options: TrackerOptions) -> None:
        if options.argument != "later":
            raise ZeroDivisionError("a fault of the example's")

    def track(self, frame: Frame) -> FaceState:
        return FaceState(**np.load(str(frame.index)))  # raised in NumPy, called from here

    def reset(self) -> None:
        """Nothing is kept between frames."""


class NearestLight:
    """A reflectance method: light from a direction is that of the nearest light that was captured."""

    def weights(self, directions: np.ndarray, queries: np.ndarray) -> np.ndarray:
        nearest = np.argmax(directions @ queries.T, axis=0)
        return (np.arange(len(directions))[:, None] == nearest).astype(np.float32)

    def build(self, samples: OlatSamples) -> ReflectanceField:
        field: FactoredField = factored_field(self, samples)
        return field


class AverageColor:
    """A relighter that paints the whole subject in the mean color of the light."""

    name, provider = "example", "numpy"

    def __init__(self, subject: Subject, options: RelighterOptions) -> None:
        self.gain = np.float32(options.argument or 1)
        self.subject = subject

    def relight(self, light_maps: np.ndarray) -> np.ndarray:
        colors = weighted_light(light_maps).sum(axis=1) / (4 * np.pi) * self.gain
        return (self.subject.matte[..., None] > 0) * colors[:, None, None].astype(np.float32)


class TopLeft:
    """A reenactor that shows the relit source image unmoved, in the output's top left corner."""

    def __init__(self, context: ReenactorContext) -> None:
        if context.argument:
            raise InputError("the reenactor example takes no argument", "name it 'example'")
        self.alpha = np.rint(context.subject.matte * 255).astype(np.uint8)

    def plan_warp(self, motion: FaceMotion, frame: Frame, quality: RenderQuality) -> WarpTask:
        return lambda relit: WarpedLayer(np.dstack([display_from_linear(relit), self.alpha]), (0, 0))


class OneColor:
    """A source of frames that are of one grey value, the argument, from 0 to 255."""

    def __init__(self, options: SourceOptions) -> None:
        self.info = SourceInfo("example", f"example:{options.argument}", options.size, options.fps)
        width, height = options.size
        self.image = np.full((height, width, 3), int(options.argument or 128), np.uint8)
        self.index = 0
        self.closed = False

    def read(self, timeout_s: float) -> Frame | None:
        if self.closed:
            return None
        time.sleep(min(timeout_s, 1 / self.info.fps))
        self.index += 1
        return Frame(self.image, self.index - 1, time.monotonic(), (self.index - 1) / self.info.fps)

    @property
    def state(self) -> SourceState:
        return SourceState.ENDED if self.closed else SourceState.RUNNING

    @property
    def reason(self) -> str:
        return ""

    def describe(self) -> SourceInfo:
        return self.info

    def close(self) -> None:
        self.closed = True


class Collector:
    """A sink that keeps all its pictures."""

    made: ClassVar[list[Collector]] = []

    def __init__(self, options: SinkOptions) -> None:
        self.options = options
        self.pictures: list[DisplayImage] = []
        self.closed = False
        self.made.append(self)

    def write(self, image: DisplayImage) -> None:
        self.pictures.append(image)

    def describe(self) -> SinkInfo:
        return SinkInfo("example", self.options.argument, self.options.size)

    def close(self) -> None:
        self.closed = True
