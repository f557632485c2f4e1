"""Reenactors: what one is (face motion → warped source image), and how one is opened by name.

A plug-in is an entry point of the group `relit_camera.reenactors`: called with a `ReenactorContext`, it gives a
`Reenactor`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from relit_camera.base.images.image_types import Frame, LinearImage, RgbaImage
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.base.plugin_groups import PluginGroup
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.render_quality import RenderQuality
from relit_camera.subject.subject import Subject


@dataclass(frozen=True)
class ReenactorContext:
    """What a reenactor works with for as long as the subject stays.

    Attributes:
        subject: the person.
        face: the face in the subject's source image, in the tracker's landmark scheme.
        size: (width, height) of the pictures to make.
        session: how to run networks.
        argument: what follows the colon in `NAME:ARGUMENT`.
    """

    subject: Subject
    face: SourceFace
    size: tuple[int, int]
    session: SessionOptions
    argument: str = ""


@dataclass(frozen=True)
class WarpedLayer:
    """A warped picture, as large as the part of the output that it covers.

    Attributes:
        image: (height, width, 4) uint8, the person as the display shows it: sRGB after the display curve, and alpha,
            straight: the colors do not hold the factor alpha.
        at: column and row of the output where its corner lies.
    """

    image: RgbaImage
    at: tuple[int, int]


WarpTask = Callable[[LinearImage], WarpedLayer]
"""Warps a relit picture (the subject's size, linear, display exposure), which it must not write to. Called at most
once, maybe in another thread while the next frame's warp is planned: it shares nothing with `plan_warp` that changes.
"""


class Reenactor(Protocol):
    """Moves the relit source image as the live face moves. Keeps state between frames; not thread-safe."""

    def plan_warp(self, motion: FaceMotion, frame: Frame, quality: RenderQuality) -> WarpTask:
        """Find out how the source image must be warped to move as `motion` says.

        What needs no relit picture is done here, what needs one in the task.

        Args:
            motion: of the live face since its neutral pose and expression.
            frame: the live frame, for networks that look at it.
            quality: what the picture may cost; a wish, not a must.
        """
        ...


REENACTORS: PluginGroup[Callable[[ReenactorContext], Reenactor]] = PluginGroup(
    "relit_camera.reenactors", "reenactor", with_argument=("onnx",)
)


def open_reenactor(name: str, context: ReenactorContext) -> Reenactor:
    """Open the reenactor `NAME` or `NAME:ARGUMENT`.

    Raises:
        NotFoundError: none of that name is installed.
        ConfigError: the plug-in cannot be loaded.
        ModelError: `onnx:FILE` names no network that keeps the contract (docs/reenactors.md).
    """
    factory, argument = REENACTORS.load(name)
    return factory(replace(context, argument=argument))
