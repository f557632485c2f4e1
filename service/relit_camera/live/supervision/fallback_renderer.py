"""The picture that is shown while the pipeline fails or hangs."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.concurrency.resident_memory import large_allocations_apart, return_freed_memory
from relit_camera.base.config.look import Mode
from relit_camera.base.config.settings import Fallback
from relit_camera.base.errors import NotFoundError
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.face.head_pose import fit_pose, unproject
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.light.light_map import LightMap
from relit_camera.live.compositing.background_renderer import BackgroundRenderer
from relit_camera.live.compositing.compositor import composite_source_image
from relit_camera.live.modes.mode import RenderedFrame
from relit_camera.live.publishing.placeholder_image import Placeholder
from relit_camera.live.publishing.what_is_shown import Rendering, Shown, Situation, what_is_shown
from relit_camera.live.reenactment.motion_transfer import split_body_motion
from relit_camera.live.reenactment.reenactor import WarpedLayer
from relit_camera.live.reenactment.source_image import Cutout, SourceFace
from relit_camera.live.reenactment.warp import Warp, move_body, source_from_output, visible_box
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.live.supervision.head_movement import HeadMovement
from relit_camera.subject.relighting.shared_relighters import shared_relighter
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FallbackPicture:
    """A picture in place of a live one.

    Attributes:
        image: uint8 sRGB RGB (height, width, 3), of the output's size.
        unlit: whether it is as filmed.
    """

    image: DisplayImage
    unlit: bool = False


HOLD_S = 10.0
"""For so long the last picture is held while nothing better can be shown."""
KEPT_S = 10.0
"""For so long the relit source image is kept after its last use: on a busy computer it is soon needed again."""


def in_a_thread(work: Callable[[], _RelitSource]) -> Future[_RelitSource]:
    """Do work that takes a tenth of a second of processor time, on a busy computer seconds, without waiting for it."""
    executor = ThreadPoolExecutor(1, "fallback")
    try:
        return executor.submit(work)
    finally:
        executor.shutdown(wait=False)


class FallbackRenderer:
    """Gives what `what_is_shown` says while no picture is rendered. Not thread-safe.

    In mode portrait it renders without tracker and reenactor: the subject's source image, relit as the scene says. It
    moves aside and nearer with the head, where that was tracked before; else it is at rest.
    """

    def __init__(
        self,
        size: tuple[int, int],
        fallback: Fallback,
        placeholder: Placeholder,
        start: Callable[[Callable[[], _RelitSource]], Future[_RelitSource]] = in_a_thread,
        hold_s: float = HOLD_S,
    ) -> None:
        """Set up; nothing is rendered yet.

        Args:
            size: (width, height) of the output in pixels.
            fallback: what is shown where the source image cannot be relit.
            placeholder: of the output's size.
            start: begins to open the relighter; whoever asks for pictures does not wait for it.
            hold_s: for so long the last picture is held, where nothing better can be shown.
        """
        self._size, self._fallback, self._placeholder, self._start = size, fallback, placeholder, start
        self._hold_s = hold_s
        self._background_renderer = BackgroundRenderer(size)
        self._light = LightTransition()
        self._head = HeadMovement()
        self._source: _RelitSource | None = None
        self._opening: tuple[Subject, Future[_RelitSource]] | None = None
        self._failing_since: float | None = None
        self._last_scene: Scene | None = None
        self._other_person = False
        self._used_at = 0.0
        self._failed_subject: Subject | None = None

    def note_live(self, frame: Frame, rendered: RenderedFrame) -> None:
        """The picture of this frame was shown: a fallback goes on from there."""
        self._last_scene, self._other_person = rendered.scene, rendered.other_person
        self._failing_since = None
        self._head.begin_at(frame, rendered.motion)

    def forget(self) -> None:
        """Nobody is shown: keep neither a frame nor the relit source image nor the background."""
        self._head.forget()
        self._failing_since = None
        self._drop()

    def release(self, now: float) -> None:
        """Free the memory of relit image and background, where no fallback was needed for `KEPT_S` until `now`."""
        if (self._source is not None or self._opening is not None) and now - self._used_at > KEPT_S:
            self._drop()
            return_freed_memory()

    def picture(self, frame: Frame, scene: Scene) -> FallbackPicture | None:
        """A picture in place of this live frame; None where the last one is held. Never raises."""
        now = frame.captured_at
        if self._failing_since is None:
            self._failing_since = now
        rest = self._at_rest(frame, scene) if scene.look.mode is Mode.PORTRAIT else None
        last = self._last_scene
        situation = Situation(
            scene.look.mode,
            has_subject=not scene.shows_nobody,
            other_person=self._other_person and last is not None and last.subject is scene.subject,
            avatar_allowed=scene.avatar_allowed,
            rendering=Rendering.FAILS if self._may_hold(now, scene) else Rendering.HAS_FAILED,
            can_rest=rest is not None,
            filmed_allowed=scene.unlit_allowed,
            filmed_when_failing=self._fallback is Fallback.FILMED,
        )
        match what_is_shown(situation):
            case Shown.HELD:
                return None
            case Shown.FILMED:
                return FallbackPicture(crop_to_fill(frame.image, self._size), unlit=True)
            case Shown.PLACEHOLDER:
                return FallbackPicture(self._placeholder.image)
        assert rest is not None
        return FallbackPicture(rest)

    def _may_hold(self, now: float, scene: Scene) -> bool:
        """Whether the last picture may stay: it is no older, and of the mode and the subject that are chosen now."""
        last, since = self._last_scene, self._failing_since
        same = last is None or (last.look.mode is scene.look.mode and last.has_same_subject(scene))
        return same and since is not None and now - since < self._hold_s

    def _at_rest(self, frame: Frame, scene: Scene) -> DisplayImage | None:
        """The source image of the scene's subject before its background; None while that cannot be made."""
        subject = scene.subject
        if subject is None or subject is self._failed_subject:
            return None
        self._used_at = frame.captured_at
        try:
            source = self._opened(subject)
            return None if source is None else self._relit(source, scene, frame)
        except Exception:  # this is what is shown when all else fails
            log.exception("the source image cannot be relit either")
            self._failed_subject = subject
            return None

    def _drop(self) -> None:
        self._source = self._opening = None
        self._background_renderer = BackgroundRenderer(self._size)

    def _opened(self, subject: Subject) -> _RelitSource | None:
        if self._source is not None and self._source.subject is subject:
            return self._source
        if self._opening is None or self._opening[0] is not subject:
            self._source = None
            self._opening = subject, self._start(lambda: _open(subject, self._size))
        opening = self._opening[1]
        if opening.done():
            self._opening = None
            self._source = opening.result()
        return self._source

    def _relit(self, source: _RelitSource, scene: Scene, frame: Frame) -> DisplayImage:
        light = self._light.update(scene, frame.time_s) * np.float32(source.subject.metadata.display_gain)
        layer = source.render(light, self._motion(frame))
        return composite_source_image(self._background_renderer, layer, scene, frame.time_s)

    def _motion(self, frame: Frame) -> FaceMotion | None:
        try:
            return self._head.motion(frame)
        except Exception:  # a person at rest is better than none
            log.exception("the head cannot be followed")
            self._head.forget()
            return None


def _open(subject: Subject, size: tuple[int, int]) -> _RelitSource:
    with large_allocations_apart():
        return _RelitSource(subject, size)


class _RelitSource:
    """The source image of one subject, placed in the output as it is at rest, or moved with the head."""

    def __init__(self, subject: Subject, size: tuple[int, int]) -> None:
        self.subject, self._size = subject, size
        self._relighter = shared_relighter(subject)
        subject.drop_pages()
        self._person = Cutout(subject)
        self._face = _stored_face(subject) if self._person.whole else None
        self._at_rest = source_from_output(subject.size, size)
        self._relit: tuple[LightMap, LinearImage] | None = None
        self._layer: tuple[LinearImage, NDArray[np.float64], WarpedLayer] | None = None

    def render(self, light: LightMap, motion: FaceMotion | None) -> WarpedLayer:
        """The person under `light`, where this motion brings them; the last layer again if neither has changed."""
        if self._relit is None or not np.array_equal(self._relit[0], light):
            self._relit = light, self._relighter.relight(light[None])[0]
        relit, placed = self._relit[1], self._placed(motion)
        last = self._layer
        if last is not None and last[0] is relit and np.array_equal(last[1], placed):
            return last[2]
        box = visible_box(placed, self.subject.size, self._size)
        layer = WarpedLayer(self._person.warped(self._person.image(relit), Warp(placed, ()).grid(box)), box[:2])
        self._layer = relit, placed, layer
        return layer

    def _placed(self, motion: FaceMotion | None) -> NDArray[np.float64]:
        if self._face is None or motion is None:
            return self._at_rest
        body = split_body_motion(self._face, motion)
        return move_body(self._at_rest, body.pivot, body.shift, body.scale, self.subject.size[1])


def _stored_face(subject: Subject) -> SourceFace | None:
    """The face by the landmarks that the subject keeps; None where it keeps none, and then it does not move."""
    for name, landmarks in subject.landmarks.items():
        try:
            scheme = landmark_scheme(name)
        except NotFoundError:  # of a tracker that is not here
            continue
        if len(landmarks) != scheme.count:
            continue
        pose = fit_pose(landmarks, scheme, subject.size)
        if pose is not None:
            return SourceFace(scheme, landmarks, pose, unproject(landmarks, pose, scheme, subject.size), subject.size)
    return None
