"""The seam between the pipeline and the modes: what a mode is given, and what it gives back for a frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.compositing.compositor import Compositor
from relit_camera.live.modes.scene_relighting import SceneRelighting
from relit_camera.live.publishing.what_is_shown import Shown
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.render_quality import RenderQuality
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.subject import Subject


@dataclass(frozen=True)
class RenderedFrame:
    """The finished picture of one live frame.

    Attributes:
        image: uint8 sRGB of the output's size.
        motion: what the face did; None while there is no tracker or no subject.
        scene: that it was made for.
        shown: the kind of picture.
        unlit: whether the person is as filmed, in a part of it or in all.
        other_person: whether the live person is known to be somebody else than the subject, who is somebody.
    """

    image: DisplayImage
    motion: FaceMotion | None
    scene: Scene
    shown: Shown = Shown.RELIT
    unlit: bool = False
    other_person: bool = False


RenderTask = Callable[[], RenderedFrame]
"""The second half of a frame's work. Called once, in the order of the frames, maybe in another thread while the next
frame is begun: it shares nothing with `begin` that changes."""


@dataclass(frozen=True)
class ModeContext:
    """What a mode works with for as long as the subject stays.

    Attributes:
        subject: the person.
        face: the face in the subject's source image, in the tracker's landmark scheme.
        scene_relighting: relights that subject as the scene says.
        open_scene_relighting: makes another one, for a subject and the face in its source image.
        anyone: makes the subject that stands for whoever else is seen, and finds its face.
        compositor: puts the person before the background.
        size: (width, height) of the pictures to make.
        timer: counts the stages.
    """

    subject: Subject
    face: SourceFace
    scene_relighting: SceneRelighting
    open_scene_relighting: Callable[[Subject, SourceFace], SceneRelighting]
    anyone: Callable[[], tuple[Subject, SourceFace]]
    compositor: Compositor
    size: tuple[int, int]
    timer: StageTimer


class RenderMode(Protocol):
    """Makes pictures of one subject in one mode. Keeps state between frames; `begin` is called by one thread."""

    def begin(
        self,
        frame: Frame,
        motion: FaceMotion,
        scene: Scene,
        quality: RenderQuality,
        others: Mapping[int, FaceMotion],
    ) -> RenderTask:
        """Do the first half of a frame's work, and return the second.

        A mode divides its work so that both halves take about as long: two frames are then at work at once.

        Args:
            frame: the live frame, of the source's size.
            motion: of the face in that frame.
            scene: what to show; its subject is that of the mode's context.
            quality: what the picture may cost.
            others: motion of further faces in mode live, each under a number of its own.

        Raises:
            ModelError: a model that the scene needs is missing; so does the render task.
        """
        ...


ModeFactory = Callable[[ModeContext], RenderMode]
"""Makes the object of a mode for a subject. May open models."""
