"""Loads what a look names: the environment that lights the face, and the picture behind the person."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from relit_camera.base.config.look import (
    Background,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Look,
)
from relit_camera.base.errors import InputError, NotFoundError
from relit_camera.base.images.color import linear_from_uint8, rgb_from_hex, uint8_from_linear
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.light.environments.background_light import panorama_from_background
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_camera.light.environments.panorama_axes import between_map_and_viewer_axes
from relit_camera.light.exposure import auto_exposure_scale
from relit_camera.light.light_map import resample_to_light_map
from relit_camera.live.scene.background_store import BackgroundStore
from relit_camera.live.scene.scene import Scene

BACKGROUND_ENVIRONMENT = "background"
"""The reserved environment name that means the light of the virtual background."""


class LookLoader:
    """Finds environments and background pictures by name, among those that are stored and those of files.

    Attributes:
        environments, backgrounds: the stores.
    """

    def __init__(self, environments: EnvironmentStore, backgrounds: BackgroundStore) -> None:
        self.environments, self.backgrounds = environments, backgrounds
        self._temporary: dict[str, Environment] = {}

    def load(self, look: Look, before: Scene) -> dict[str, object]:
        """The fields of a scene with that look: the look, its environment and its background picture.

        Args:
            look: to be shown.
            before: the present scene; what both have in common is taken from there.

        Raises:
            NotFoundError: an environment or background of that name is not stored.
            InputError: `background` as environment while the background cannot light.
        """
        # A slider sends dozens of changes a second, so what did not change is not read again.
        image = before.background_image if look.background == before.look.background else None
        if image is None:
            image = self._background_image(look.background)
        environment = _unchanged_environment(look, before) or self._environment(look, image)
        return {"look": look, "environment": environment, "background_image": image}

    @staticmethod
    def loaded(look: Look, scenes: Sequence[Scene]) -> dict[str, object] | None:
        """The same, taken from scenes that have it already; None where something has to be loaded first."""
        environment, image = None, None
        if isinstance(look.background, ImageBackground):
            image = next((each.background_image for each in scenes if each.look.background == look.background), None)
            if image is None:
                return None
        if look.lighting.environment is not None:
            found = (_unchanged_environment(look, each) for each in scenes)
            environment = next((each for each in found if each is not None), None)
            if environment is None:
                return None
        return {"look": look, "environment": environment, "background_image": image}

    def register(self, name_or_path: str) -> str:
        """Make the environment of a file available under a name, for this run only; a stored one keeps its own name.

        Returns:
            The name by which a look can choose it.

        Raises:
            NotFoundError: neither a stored name nor a file.
            PanoramaError: the file cannot be used as light.
        """
        if name_or_path == BACKGROUND_ENVIRONMENT or name_or_path in self.environments.names():
            return name_or_path
        environment = self.environments.resolve(name_or_path)
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", Path(name_or_path).stem).strip("-_")[:50] or "file"
        if name == BACKGROUND_ENVIRONMENT or name in self.environments.names():
            name += "-file"
        self._temporary = {**self._temporary, name: environment}  # others read it meanwhile
        return name

    def temporary_environments(self) -> dict[str, Environment]:
        """The environments registered from files for this run, by name."""
        return dict(self._temporary)

    def background_names(self) -> list[str]:
        """The names that an `image` background may use: stored pictures and environments."""
        return sorted({*self.backgrounds.names(), *self.environments.names()})

    def _environment(self, look: Look, background_image: DisplayImage | None) -> Environment | None:
        name = look.lighting.environment
        if name is None:
            return None
        if name != BACKGROUND_ENVIRONMENT:
            # Not `resolve`: a name from the API must not reach files outside the store.
            return self._temporary[name] if name in self._temporary else self.environments.load(name)
        background = look.background
        if isinstance(background, ImageBackground) and background.image in self.environments.names():
            return self.environments.load(background.image)
        if isinstance(background, ColorBackground):
            background_image = np.full((90, 160, 3), rgb_from_hex(background.color), dtype=np.uint8)
        if background_image is None:
            kind = "an environment needs a name" if isinstance(background, EnvironmentBackground) else "has no picture"
            raise InputError(
                f"the face cannot be lit by a background of kind '{background.kind}': it {kind}",
                "choose an image or color background first",
            )
        panorama = panorama_from_background(linear_from_uint8(background_image))
        return Environment(BACKGROUND_ENVIRONMENT, panorama, resample_to_light_map(panorama.radiance), panorama.notes)

    def _background_image(self, background: Background) -> DisplayImage | None:
        if not isinstance(background, ImageBackground):
            return None
        if background.image in self.backgrounds.names():
            return self.backgrounds.load(background.image)
        if background.image in self.environments.names():
            environment = self.environments.load(background.image)
            seen = between_map_and_viewer_axes(environment.panorama.radiance)
            # A white wall of irradiance 1 reads 1 and has radiance 1/π: with the factor π, background and face match.
            return uint8_from_linear(seen * np.float32(np.pi * auto_exposure_scale(environment.light_map)))
        known = ", ".join(self.background_names()) or "none"
        raise NotFoundError(f"no background picture '{background.image}'", f"there are: {known}")


def _unchanged_environment(look: Look, scene: Scene) -> Environment | None:
    before = scene.look
    if look.lighting.environment != before.lighting.environment:
        return None
    stays = look.lighting.environment != BACKGROUND_ENVIRONMENT or look.background == before.background
    return scene.environment if stays else None
