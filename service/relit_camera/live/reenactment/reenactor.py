"""The seam between a relit still and a living picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Protocol

from relit_camera.base.errors import NotFoundError
from relit_camera.base.images.image_types import Frame, LinearImage, Mask
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.subject.relighting.relighter import Relighter
from relit_camera.subject.subject import Subject

ENTRY_POINT_GROUP = "relit_camera.reenactors"


@dataclass(frozen=True)
class ReenactorContext:
    """What a reenactor works with for as long as the subject stays.

    Attributes:
        subject: the person.
        relighter: of the same subject; a reenactor may relight under other lights than the scene's.
        face: the face in the subject's still, in the tracker's landmark scheme.
        size: (width, height) of the pictures to make.
        options: how ONNX Runtime runs.
    """

    subject: Subject
    relighter: Relighter
    face: SourceFace
    size: tuple[int, int]
    options: SessionOptions


@dataclass(frozen=True)
class WarpedLayer:
    """A moved picture: the part of the output that it covers.

    Attributes:
        picture: (height, width, 3) float32 linear, premultiplied with `alpha`, in display exposure.
        alpha: (height, width) float32, the person.
        at: column and row of the output where its corner lies.
    """

    picture: LinearImage
    alpha: Mask
    at: tuple[int, int]


WarpTask = Callable[[LinearImage], WarpedLayer]
"""Moves a relit picture (subject's size, linear, display exposure). Called at most once, maybe in another thread while
the next frame is followed: it shares nothing with that which changes."""


class Reenactor(Protocol):
    """Moves a relit still as the live face moves. Keeps state between frames; not thread-safe."""

    def plan_warp(self, motion: FaceMotion, frame: Frame) -> WarpTask:
        """Find out how the still must move as `motion` says.

        All that can be done without the relit picture belongs here: it runs while that is being made. `frame` is the
        live picture, for reenactors that build on it.
        """
        ...


def open_reenactor(name: str, stage: ReenactorContext) -> Reenactor:
    """A reenactor of that name.

    Raises:
        NotFoundError: none of that name is installed.
    """
    for point in entry_points(group=ENTRY_POINT_GROUP, name=name):
        reenactor: Reenactor = point.load()(stage)
        return reenactor
    known = ", ".join(sorted(point.name for point in entry_points(group=ENTRY_POINT_GROUP)))
    raise NotFoundError(f"no reenactor '{name}'", f"there are: {known}")
