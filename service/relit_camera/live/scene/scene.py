"""The scene: everything that the pipeline has to show, as one immutable value."""

from __future__ import annotations

from dataclasses import dataclass

from relit_camera.base.config.look import ANYONE, Look, Mode
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.light.environments.environment_panorama import Environment
from relit_camera.subject.subject import Subject


@dataclass(frozen=True)
class Scene:
    """What to show, with every name replaced by what it names. The pipeline reads one scene a frame, without a lock.

    Attributes:
        look: lighting, background and mode as the user set them.
        environment: the environment that lights the face; None for lamps only.
        background_image: the picture of an `image` background, uint8 sRGB RGB (height, width, 3); None for other kinds.
        subject_name: name of the subject, for status and panel.
        subject: the person shown; None shows nobody, or in mode live whoever comes where the name is `ANYONE`.
        frozen: whether the published picture is held.
        unlit_allowed: whether the picture as filmed may be published: where there is no subject, no face, before and
            after. Else what `what_is_shown` says is.
        avatar_allowed: whether others may move this subject's portrait (mode portrait).
        revision: number of changes so far.
        mode_revision: the revision with which the look's mode was last changed.
        can_undo, can_redo: whether there is a change to undo, or to do again.
    """

    look: Look
    environment: Environment | None = None
    background_image: DisplayImage | None = None
    subject_name: str | None = None
    subject: Subject | None = None
    frozen: bool = False
    unlit_allowed: bool = False
    avatar_allowed: bool = False
    revision: int = 0
    mode_revision: int = 0
    can_undo: bool = False
    can_redo: bool = False

    @property
    def shows_nobody(self) -> bool:
        """Whether nobody is relit: a placeholder is shown, or the picture as filmed where that is allowed."""
        return self.subject is None and not (self.subject_name == ANYONE and self.look.mode is Mode.LIVE)

    def has_same_subject(self, other: Scene) -> bool:
        """Whether the same one is chosen in both, perhaps under another name."""
        return self.subject is other.subject and (self.subject is not None or self.subject_name == other.subject_name)
