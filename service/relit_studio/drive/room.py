"""Room of a driving video: its panorama as light for Cycles and as background behind the person."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from relit_camera.base.images.image_files import write_linear
from relit_camera.base.images.image_types import DisplayImage, LinearImage, Mask
from relit_camera.base.images.tone_mapping import display_from_linear, linear_from_display
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map_rotation import rotate_light_map
from relit_camera.live.compositing.alpha_compositing import over, unpremultiply
from relit_camera.live.compositing.environment_view import EnvironmentView
from relit_studio.cameras.studio_camera import Camera
from relit_studio.cycles.job import PanoramaLight

_BLUR = 0.05
"""Defocus blur of the background, since the webcam focuses on the person."""


@dataclass(frozen=True, eq=False)
class Room:
    """Environment around the person, rotated by `yaw_deg` (positive moves a frontal light to the picture's right)."""

    environment: Environment
    yaw_deg: float = 0.0

    @cached_property
    def scale(self) -> float:
        """The exposure: a white ball that faces the camera reads 0.8."""
        return auto_exposure_scale(self.light_map)

    @cached_property
    def light_map(self) -> LinearImage:
        """Light map (32, 64, 3) around the person."""
        return rotate_light_map(self.environment.light_map, rotation_from_angles(self.yaw_deg).inv())

    def light(self, folder: Path) -> PanoramaLight:
        """Light for Cycles; writes the rotated panorama into `folder`.

        Raises:
            StorageError: the folder cannot be written.
        """
        radiance = self.environment.panorama.radiance
        columns = round(self.yaw_deg / 360 * radiance.shape[1])
        turned = np.roll(radiance, columns, axis=1)
        # Cycles takes pictures as seen from inside the sphere.
        path = folder / "room.exr"
        write_linear(path, np.ascontiguousarray(turned[:, ::-1]))
        return PanoramaLight(str(path))

    def backdrop(self, camera: Camera) -> DisplayImage:
        """Background behind the person after exposure, uint8 sRGB (height, width, 3)."""
        height_deg = float(np.degrees(2 * np.arctan(camera.height / 2 / camera.focal_px)))
        view = EnvironmentView(self.environment.panorama, camera.size, height_deg, _BLUR)
        return view.picture(rotation_from_angles(self.yaw_deg), self.scale)

    def behind(self, camera: Camera) -> LinearImage:
        """Background as linear light, in the unit of rendered pictures; lamps are clipped at twice white."""
        return linear_from_display(self.backdrop(camera)) / np.float32(self.scale)

    def shown(self, picture: LinearImage, alpha: Mask, backdrop: DisplayImage) -> DisplayImage:
        """A rendered picture (h, w, 3), premultiplied, composited over the backdrop, uint8 sRGB."""
        colors = unpremultiply(picture, alpha) * np.float32(self.scale)
        return over(display_from_linear(colors), np.clip(alpha, 0, 1), backdrop)
