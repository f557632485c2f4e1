"""The seam between a relit still and a living picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Protocol

from relit_camera.errors import NotFoundError
from relit_camera.face.follow import FaceMotion
from relit_camera.models.session import SessionOptions
from relit_camera.reenact.source_face import SourceFace
from relit_camera.relight.relighter import Relighter
from relit_camera.space.images import Frame, LinearImage, Mask
from relit_camera.subject.subject import Subject

GROUP = "relit_camera.reenactors"


@dataclass(frozen=True)
class Stage:
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
class Moved:
    """A moved picture: the part of the output that it covers.

    Attributes:
        picture: (height, width, 3) float32 linear, premultiplied with `alpha`, in display exposure.
        alpha: (height, width) float32, the person.
        at: column and row of the output where its corner lies.
    """

    picture: LinearImage
    alpha: Mask
    at: tuple[int, int]


Move = Callable[[LinearImage], Moved]
"""Moves a relit picture (subject's size, linear, display exposure). Called at most once, maybe in another thread while
the next frame is followed: it shares nothing with that which changes."""


class Reenactor(Protocol):
    """Moves a relit still as the live face moves. Keeps state between frames; not thread-safe."""

    def follow(self, motion: FaceMotion, frame: Frame) -> Move:
        """Find out how the still must move as `motion` says.

        All that can be done without the relit picture belongs here: it runs while that is being made. `frame` is the
        live picture, for reenactors that build on it.
        """
        ...


def open_reenactor(name: str, stage: Stage) -> Reenactor:
    """A reenactor of that name.

    Raises:
        NotFoundError: none of that name is installed.
    """
    for point in entry_points(group=GROUP, name=name):
        reenactor: Reenactor = point.load()(stage)
        return reenactor
    known = ", ".join(sorted(point.name for point in entry_points(group=GROUP)))
    raise NotFoundError(f"no reenactor '{name}'", f"there are: {known}")
