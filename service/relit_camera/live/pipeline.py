"""The picture of one live frame: the face is tracked, then the mode that the scene asks for makes the picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

from relit_camera.base.concurrency.resident_memory import large_allocations_apart
from relit_camera.base.config.look import Mode, NoBackground
from relit_camera.base.images.image_types import DisplayImage, Frame
from relit_camera.face.face_state import FaceStatus, Tracker
from relit_camera.face.identity.face_embedder import FaceEmbedder
from relit_camera.face.identity.identity_judge import Verdict
from relit_camera.face.identity.live_identity import LiveIdentity
from relit_camera.face.landmarks.landmark_schemes import landmark_scheme
from relit_camera.face.matting import Matting
from relit_camera.face.motion.face_follower import FaceFollower, FaceMotion
from relit_camera.face.tracking.further_faces import FurtherFaces
from relit_camera.face.tracking.interval_tracker import IntervalTracker
from relit_camera.live.compositing.compositor import Compositor
from relit_camera.live.modes.frame_fitting import fit_frame
from relit_camera.live.modes.mode import ModeContext, ModeFactory, RenderedFrame, RenderMode, RenderTask
from relit_camera.live.modes.scene_relighting import SceneRelighting
from relit_camera.live.publishing.what_is_shown import Shown, Situation, what_is_shown
from relit_camera.live.reenactment.source_image import SourceFace, find_source_face
from relit_camera.live.render_quality import FULL_QUALITY, RenderQuality
from relit_camera.live.scene.light_transition import LightTransition
from relit_camera.live.scene.scene import Scene
from relit_camera.live.status.camera_status import Degradation, DegradationCode
from relit_camera.live.status.stage_timing import StageTimer
from relit_camera.subject.relighting.relighter import Relighter
from relit_camera.subject.subject import Subject

__all__ = ["Pipeline", "RenderTask", "RenderedFrame", "subject_troubles"]


def subject_troubles(scene: Scene) -> list[Degradation]:
    """What works less well than asked because nobody is chosen; nothing where somebody is."""
    if not scene.shows_nobody:
        return []
    shown = "the live picture is shown as it is" if scene.unlit_allowed else "a placeholder is shown"
    cure = "choose or capture one in the panel, or name one with --subject"
    return [Degradation(code=DegradationCode.NO_SUBJECT, what=shown, why="no subject is chosen", cure=cure)]


PLAIN_TURN_DEG = 30.0
"""Angle between nose and camera up to which a face is looked at to tell whose it is."""


@dataclass(frozen=True)
class _ActiveMode:
    """The mode at work, and the subject that it was made for."""

    subject: Subject
    name: Mode
    relighter: Relighter
    mode: RenderMode


class Pipeline:
    """Makes relit pictures of live frames. What may change reaches it as a `Scene` a frame.

    A frame is made in two halves, `begin` and the `RenderTask` that it returns. One thread may begin the next frame
    while another calls the task of this one; tasks keep the order of their frames. So two cores have a frame each
    thirtieth of a second that takes one core longer.

    Attributes:
        timer: how long each stage took.
        quality: what a picture may cost; any thread may replace it, and the next frame is begun with it.
        on_opening: called before models are opened, which may take long: those of a subject or mode, or of the matte.
    """

    def __init__(
        self,
        tracker: Tracker,
        make_follower: Callable[[], FaceFollower],
        size: tuple[int, int],
        modes: Mapping[Mode, ModeFactory],
        open_relighter: Callable[[Subject], Relighter],
        open_matte: Callable[[], Matting],
        make_anyone: Callable[[], Subject],
        open_embedder: Callable[[], FaceEmbedder],
        is_nobodys: Callable[[Subject], bool],
        draw_other_person: Callable[[], DisplayImage],
    ) -> None:
        """Set up; the first frame of a subject opens its models.

        Args:
            tracker: measures the face in each frame.
            make_follower: makes what smooths the states of one face into motion since its neutral face.
            size: (width, height) of the pictures to make.
            modes: how each mode is made for a subject.
            open_relighter: makes the relighter of a subject.
            open_matte: called when a live person must first be parted from the room.
            make_anyone: makes the subject that stands for whoever comes while nobody is chosen, or somebody else.
            open_embedder: opens the network that tells people apart; it may be missing.
            is_nobodys: whether a subject does not exist, so that anybody may move their portrait.
            draw_other_person: draws the placeholder that is shown where somebody else may not, of that size.
        """
        self.timer = StageTimer()
        self.quality = FULL_QUALITY
        self.on_opening: Callable[[], None] = lambda: None
        self._tracker = tracker
        self._live_tracker = IntervalTracker(tracker)
        self._follower = make_follower()
        self._further_faces = FurtherFaces(tracker, make_follower)
        self._size = size
        self._modes = modes
        self._open_relighter = open_relighter
        self._light = LightTransition()
        self._open_matte = open_matte
        self._make_anyone = make_anyone
        self._identity = LiveIdentity(self._opened_embedder, landmark_scheme(tracker.scheme))
        self._open_embedder = open_embedder
        self._is_nobodys, self._draw_other_person = is_nobodys, draw_other_person
        self._not_them: Subject | None = None
        self._placeholder: DisplayImage | None = None
        self._anyone: Subject | None = None
        self._troubles: dict[str, Degradation] = {}
        self._compositor = Compositor(size, self._opened_matte, self.timer, self._troubles)
        self._active: _ActiveMode | None = None

    @property
    def troubles(self) -> list[Degradation]:
        """What works less well than asked."""
        return list(self._troubles.values())

    @property
    def providers(self) -> dict[str, str]:
        """The relighter at work, and what runs it: name → `numpy` or an execution provider; empty before the first."""
        active = self._active
        return {} if active is None else {f"relighter {active.relighter.name}": active.relighter.provider}

    def reset_neutral(self) -> None:
        """Take the neutral face anew. May be called from any thread."""
        self._follower.reset_neutral()

    def close(self) -> None:
        """Let go of models and pictures.

        No frame can be begun afterwards. What holds this object, and is held by it, would else keep them until Python
        looks for such cycles: hours in a running camera, and never those of its start (`freeze_gc`).
        """
        self._active = None
        self.on_opening = lambda: None
        with suppress(AttributeError):  # closed before
            del self._compositor

    def process(self, frame: Frame, scene: Scene) -> RenderedFrame:
        """Make the picture of one live frame: begin it, and finish it at once.

        Raises:
            SubjectError: no face is found in the subject's source image.
            ModelError: a model that the scene needs is missing.
        """
        return self.begin(frame, lambda: scene)()

    def begin(self, frame: Frame, scene_now: Callable[[], Scene]) -> RenderTask:
        """Do the first half of a frame's work, and return the second.

        The scene is asked for as late as can be, after the face is tracked: so a change shows that much earlier.

        Raises:
            SubjectError: no face is found in the subject's source image.
            ModelError: a model that the scene needs is missing; so does the task.
        """
        quality = self.quality
        scene = scene_now()
        tracked = None if scene.shows_nobody else self._track(frame, scene, quality)
        scene = scene_now()
        if scene.shows_nobody:
            self._further_faces.forget()
            return lambda: self._render_unrelit(frame, scene)
        if tracked is None:  # the subject was chosen while this frame went untracked: no unlit picture under its scene
            tracked = self._track(frame, scene, quality)
        motion, others = tracked
        is_other = self._is_other_person(frame, motion, scene)
        other_person = is_other and scene.subject is not None and not self._is_nobodys(scene.subject)
        now = Situation(scene.look.mode, other_person=other_person, avatar_allowed=scene.avatar_allowed)
        if what_is_shown(now) is Shown.PLACEHOLDER:
            self._note_other_person("a placeholder is shown", scene, "or allow others to move this portrait")
            if self._placeholder is None:
                self._placeholder = self._draw_other_person()
            hidden = RenderedFrame(self._placeholder, motion, scene, Shown.PLACEHOLDER, other_person=True)
            return lambda: hidden
        self._placeholder = None
        subject = scene.subject
        if is_other and scene.look.mode is Mode.LIVE:
            self._note_other_person("you are lit as an average head would be", scene, "or take one")
            subject = None
        else:
            self._troubles.pop("identity", None)
        mode = self._mode(subject or self._opened_anyone(), scene.look.mode)
        render = mode.begin(frame, motion, scene, quality, others)
        return lambda: replace(render(), other_person=other_person)

    def _track(self, frame: Frame, scene: Scene, quality: RenderQuality) -> tuple[FaceMotion, Mapping[int, FaceMotion]]:
        """The motion of the face that the camera is for, and in mode live that of the others by their numbers."""
        is_live = scene.look.mode is Mode.LIVE
        with self.timer.stage("track"):
            every = quality.live_track_every if is_live else quality.track_every
            self._live_tracker.set_interval(every, follow_lips=not is_live)
            state = self._live_tracker.track(frame)
            motion = self._follower.follow(state, frame.size, frame.time_s)
        if not is_live:
            self._further_faces.forget()
            return motion, {}
        with self.timer.stage("others"):
            return motion, self._further_faces.follow(frame, state, every)

    def _render_unrelit(self, frame: Frame, scene: Scene) -> RenderedFrame:
        live = fit_frame(frame, self._size)
        image, look = live.image, scene.look
        if not isinstance(look.background, NoBackground) or look.lighting.background_gain_ev != 0:
            image = self._compositor.composite_live(image, self._compositor.person_alpha(live, scene), live, scene)
        shown = what_is_shown(Situation(scene.look.mode, has_subject=False, filmed_allowed=True))
        # The publisher shows it only where that is allowed.
        return RenderedFrame(image, None, scene, shown, unlit=True)

    def _is_other_person(self, frame: Frame, motion: FaceMotion, scene: Scene) -> bool:
        """Whether the live person is somebody else than the subject, as was known last: lost faces change nothing."""
        if scene.subject is None:
            return False
        plain = motion.status is FaceStatus.FOUND and motion.pose is not None and motion.pose.turn_deg <= PLAIN_TURN_DEG
        landmarks = None if motion.status is FaceStatus.LOST else motion.landmarks
        with self.timer.stage("identity"):
            verdict = self._identity.verdict(scene.subject, frame.image, landmarks, plain, frame.time_s)
        if verdict is Verdict.OTHER:
            self._not_them = scene.subject
        elif verdict is Verdict.SAME or self._not_them is not scene.subject:
            self._not_them = None
        return self._not_them is not None

    def _note_other_person(self, shown: str, scene: Scene, cure: str) -> None:
        self._troubles["identity"] = Degradation(
            shown,
            f"this is somebody else than {scene.subject_name or 'the subject'}",
            f"choose your own subject, {cure}",
            code=DegradationCode.OTHER_PERSON,
        )

    def _opened_anyone(self) -> Subject:
        if self._anyone is None:
            self.on_opening()
            self._anyone = self._make_anyone()
        return self._anyone

    def _anyone_and_face(self) -> tuple[Subject, SourceFace]:
        subject = self._opened_anyone()
        return subject, find_source_face(subject, self._tracker)

    def _opened_embedder(self) -> FaceEmbedder:
        self.on_opening()
        return self._open_embedder()

    def _opened_matte(self) -> Matting:
        self.on_opening()
        return self._open_matte()

    def _open_scene_relighting(self, subject: Subject, face: SourceFace) -> SceneRelighting:
        return SceneRelighting(subject, face, self._open_relighter(subject), self._light, self.timer)

    def _mode(self, subject: Subject, name: Mode) -> RenderMode:
        """The object of that mode for that subject, made anew when either changes."""
        active = self._active
        same_subject = active is not None and active.subject is subject
        if active is not None and same_subject and active.name is name:
            return active.mode
        self.on_opening()
        self._further_faces.release()  # or the tracker would pass over a face in the source image
        with large_allocations_apart():
            relighter = active.relighter if active is not None and same_subject else self._open_relighter(subject)
            face = find_source_face(subject, self._tracker)
            context = ModeContext(
                subject=subject,
                face=face,
                scene_relighting=SceneRelighting(subject, face, relighter, self._light, self.timer),
                open_scene_relighting=self._open_scene_relighting,
                anyone=self._anyone_and_face,
                compositor=self._compositor,
                size=self._size,
                timer=self.timer,
            )
            self._active = _ActiveMode(subject, name, relighter, self._modes[name](context))
        subject.drop_pages()
        return self._active.mode
