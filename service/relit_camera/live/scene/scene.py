"""The one value through which control reaches the picture path."""

from __future__ import annotations

from dataclasses import dataclass

from relit_camera.base.config.look import Look
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.light.environment_panorama import Environment
from relit_camera.subject.subject import Subject


@dataclass(frozen=True)
class Scene:
    """What to show, with every name resolved: the worker reads one a frame and waits for nothing.

    Attributes:
        look: the settings as the user gave them.
        environment: what lights the face, or None for lamps only.
        backdrop: the picture of an `image` background, else None.
        subject_name: for status and panel.
        subject: who is shown, or None: then the live picture passes through unlit.
        frozen: the published picture stands still.
        revision: counts changes.
    """

    look: Look
    environment: Environment | None = None
    backdrop: DisplayImage | None = None
    subject_name: str | None = None
    subject: Subject | None = None
    frozen: bool = False
    revision: int = 0
