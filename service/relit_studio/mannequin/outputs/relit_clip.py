"""The driving clip's performance under another environment: ground truth of a relit clip."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.base.video.video_writer import VideoWriter
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import LightMap
from relit_studio.base.progress import Progress, no_progress
from relit_studio.mannequin.outputs.driving_clip import CLIP_LIGHTS, CLIP_SIZE
from relit_studio.mannequin.outputs.mannequin_performance import FPS, FRAMES, frame_times, posture_at
from relit_studio.mannequin.outputs.olat import gray
from relit_studio.mannequin.rendering.distant_lights import lights_from_map
from relit_studio.mannequin.rendering.mannequin_camera import Camera
from relit_studio.mannequin.rendering.renderer import View


def write_relit(
    video: Path, matte: Path, light_map: LightMap, frames: int = FRAMES, progress: Progress = no_progress
) -> None:
    """Write the performance's first `frames` under `light_map`, over black, and its matte as a gray video.

    It is shown as the program shows relit pictures: a white ball that faces the camera reads 0.8, then the display
    curve.

    Raises:
        ImageError: not a light map.
        StorageError: a file cannot be written.
    """
    camera, size = Camera(CLIP_SIZE), (CLIP_SIZE, CLIP_SIZE)
    lights, scale = lights_from_map(light_map, CLIP_LIGHTS), np.float32(auto_exposure_scale(light_map))
    with VideoWriter(video, size, FPS) as person, VideoWriter(matte, size, FPS) as outline:
        for index, time_s in enumerate(frame_times(frames).tolist()):
            view = View(posture_at(time_s), camera)
            person.write(display_from_linear(view.under_lights(lights) * scale), time_s)
            outline.write(gray(view.matte()), time_s)
            progress(index + 1, frames)
