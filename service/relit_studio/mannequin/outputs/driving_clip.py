"""Driving clip of the mannequin in a room, and its true track."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from relit_camera.base.images.color import uint8_from_linear
from relit_camera.base.images.image_types import Frame, LinearImage
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.face.face_state import FaceState, FaceStatus
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.tracking.track_recording import TrackRecorder
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import LightMap
from relit_camera.light.light_map_interpolation import pad_poles, padded_positions
from relit_studio.base.progress import Progress, no_progress
from relit_studio.mannequin.outputs.mannequin_performance import FPS, FRAMES, frame_times, posture_at
from relit_studio.mannequin.outputs.olat import landmarks_px
from relit_studio.mannequin.rendering.distant_lights import lights_from_map
from relit_studio.mannequin.rendering.mannequin_camera import DISTANCE_CM, VIEW_CM, Camera
from relit_studio.mannequin.rendering.renderer import View
from relit_studio.mannequin.shape.figure import Posture

CLIP_SIZE = 320
CLIP_LIGHTS = 32
"""Number of distant lights that approximate a light map."""


class TruthTracker:
    """Tracker that gives the true face state of the clip at the frame's time."""

    name = "truth"
    scheme = "mesh478"

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def track(self, frame: Frame) -> FaceState:
        """The true state at the frame's time."""
        return true_state(self._camera, posture_at(frame.time_s))

    def reset(self) -> None:
        """Nothing is kept between frames."""


def true_state(camera: Camera, posture: Posture) -> FaceState:
    """Face state as a perfect tracker of scheme mesh478 gives it; openings are measured in the picture."""
    scheme = landmark_scheme(TruthTracker.scheme)
    points, expression = landmarks_px(camera, posture), posture.expression
    return FaceState(
        status=FaceStatus.FOUND,
        confidence=1.0,
        scheme=scheme.name,
        landmarks=points,
        pose=camera.head_pose(posture),
        eyes=scheme.eyes_opening(points),
        mouth=scheme.mouth_opening(points),
        blendshapes={
            "jawOpen": expression.jaw,
            "eyeBlinkRight": expression.blink_right,
            "eyeBlinkLeft": expression.blink_left,
            "mouthSmileRight": expression.smile,
            "mouthSmileLeft": expression.smile,
            "browInnerUp": max(expression.brows, 0.0),
        },
    )


def render_clip(
    light_map: LightMap, camera: Camera | None = None, times: Sequence[float] | None = None
) -> Iterator[LinearImage]:
    """Frames (size, size, 3) of the clip under any light map: linear, unscaled, before the map as seen behind the head.

    Args:
        light_map: in room axes.
        camera: 320 x 320 unless given.
        times: seconds; every frame of the clip unless given.

    Raises:
        ImageError: not a light map.
    """
    camera = camera or Camera(CLIP_SIZE)
    lights = lights_from_map(light_map, CLIP_LIGHTS)
    behind = backdrop(light_map, camera)
    for time_s in frame_times() if times is None else times:
        view = View(posture_at(float(time_s)), camera)
        yield view.under_lights(lights) + behind * (1 - view.matte()[..., None])


def backdrop(light_map: LightMap, camera: Camera) -> LinearImage:
    """The far wall (size, size, 3) that the camera sees past the mannequin: a wall that sends out this light.

    The project's unit is a white wall under unit irradiance; it sends out 1 / π of that as radiance.
    """
    across = (np.arange(camera.size) + 0.5 - camera.size / 2) / camera.size * VIEW_CM / DISTANCE_CM
    x, y = np.meshgrid(across, -across)
    length = np.sqrt(x * x + y * y + 1)
    row, column = padded_positions(x / length, y / length, -1 / length)
    return np.asarray(np.pi * cv2.remap(pad_poles(light_map), column, row, cv2.INTER_LINEAR), np.float32)


def write_clip(
    video: Path, track: Path, light_map: LightMap, frames: int = FRAMES, progress: Progress = no_progress
) -> None:
    """Write the clip's first `frames` under `light_map`, exposed for a white ball at 0.8, and its true track.

    Raises:
        ImageError: not a light map.
        StorageError: a file cannot be written.
    """
    camera, times = Camera(CLIP_SIZE), frame_times(frames)
    scale = np.float32(auto_exposure_scale(light_map))
    tracker = TruthTracker(camera)
    recorder = TrackRecorder(tracker, (camera.size, camera.size), FPS)
    with VideoWriter(video, (camera.size, camera.size), FPS) as writer:
        for index, picture in enumerate(render_clip(light_map, camera, times.tolist())):
            frame = Frame(uint8_from_linear(picture * scale), index, 0.0, float(times[index]))
            writer.write(frame.image, frame.time_s)
            recorder.add(tracker.track(frame), frame.time_s)
            progress(index + 1, len(times))
    recorder.write(track)
