"""Makes the next scene from what users change: looks up names, checks that the parts fit, and replaces the scene."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from relit_camera.base.config.look import (
    Background,
    ColorBackground,
    EnvironmentBackground,
    ImageBackground,
    Look,
    Mode,
)
from relit_camera.base.config.settings import StorageSettings
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
from relit_camera.subject.subject import Subject
from relit_camera.subject.subject_store import SubjectStore

BACKGROUND_ENVIRONMENT = "background"
"""The reserved environment name that means the light of the virtual background."""


class SceneController:
    """Holds the scene, and the stores of what it can show. Thread-safe: changes are made one at a time.

    A change that names something unknown raises an error and leaves the scene as it was.

    Attributes:
        scene: the present scene; reading it takes no lock.
        environments, subjects, backgrounds: the stores.
    """

    def __init__(self, storage: StorageSettings) -> None:
        self.environments = EnvironmentStore(storage.environments)
        self.subjects = SubjectStore(storage.subjects, copied=True)
        self.backgrounds = BackgroundStore(storage.backgrounds)
        self._change = threading.Lock()
        self._temporary_environments: dict[str, Environment] = {}
        self.scene = Scene(Look())

    def set_look(self, look: Look) -> Scene:
        """Show another lighting, background or mode.

        Raises:
            NotFoundError: an environment or background of that name is not stored.
            InputError: `background` as environment while the background cannot light.
        """
        return self.update_look(lambda _: look)

    def update_look(self, change: Callable[[Look], Look]) -> Scene:
        """Show what `change` makes of the present look. Other changes wait until it is replaced.

        Raises:
            NotFoundError, InputError: as `set_look`.
        """
        with self._change:
            look = change(self.scene.look)
            # A slider sends dozens of changes a second, so what did not change is not read again.
            image = self.scene.background_image if look.background == self.scene.look.background else None
            if image is None:
                image = self._background_image(look.background)
            environment = self._unchanged_environment(look) or self._environment(look, image)
            return self._replace(look=look, environment=environment, background_image=image)

    def choose_stored_subject(self, name: str | None, mode: Mode | None = None) -> Scene:
        """Show a subject of the store, or none. For names from the API: never a file elsewhere.

        Whoever asks for none may be shown the live picture unlit (`Scene.unlit_allowed`). With `mode` the mode changes
        in the same step.

        Raises:
            NotFoundError: no stored subject has that name.
            SubjectError: its file is damaged.
        """
        with self._change:
            subject = None if name is None else self.subjects.load(name)
            unlit_allowed = self.scene.unlit_allowed or name is None
            look = self.scene.look if mode is None else self.scene.look.model_copy(update={"mode": mode})
            return self._replace(subject=subject, subject_name=name, unlit_allowed=unlit_allowed, look=look)

    def load_configured_subject(self, name_or_path: str | None) -> Scene:
        """Show the subject that the command line or the configuration names: a stored one, else a file; or none.

        Raises:
            NotFoundError: neither a stored name nor a file.
            SubjectError: the file is damaged.
        """
        if name_or_path is None:
            return self.choose_stored_subject(None)
        return self.show_subject(*self.subjects.resolve(name_or_path))

    def show_subject(self, name: str, subject: Subject) -> Scene:
        """Show a subject that is not stored, under `name`."""
        with self._change:
            return self._replace(subject=subject, subject_name=name)

    def set_frozen(self, frozen: bool) -> Scene:
        """Hold the published picture, or continue."""
        with self._change:
            return self._replace(frozen=frozen)

    def set_unlit_allowed(self, allowed: bool) -> Scene:
        """Say whether the live picture may be shown as it is while there is no subject."""
        with self._change:
            return self._replace(unlit_allowed=allowed)

    def register_temporary_environment(self, name_or_path: str) -> str:
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
        with self._change:
            self._temporary_environments[name] = environment
        return name

    def temporary_environments(self) -> dict[str, Environment]:
        """The environments registered from files for this run, by name."""
        return dict(self._temporary_environments)

    def background_names(self) -> list[str]:
        """The names that an `image` background may use: stored pictures and environments."""
        return sorted({*self.backgrounds.names(), *self.environments.names()})

    def _replace(self, **changes: object) -> Scene:
        self.scene = replace(self.scene, **changes, revision=self.scene.revision + 1)  # type: ignore[arg-type]
        return self.scene

    def _unchanged_environment(self, look: Look) -> Environment | None:
        before = self.scene.look
        if look.lighting.environment != before.lighting.environment:
            return None
        stays = look.lighting.environment != BACKGROUND_ENVIRONMENT or look.background == before.background
        return self.scene.environment if stays else None

    def _environment(self, look: Look, background_image: DisplayImage | None) -> Environment | None:
        name = look.lighting.environment
        if name is None:
            return None
        if name != BACKGROUND_ENVIRONMENT:
            # Not `resolve`: a name from the API must not reach files outside the store.
            return (
                self._temporary_environments[name]
                if name in self._temporary_environments
                else self.environments.load(name)
            )
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
