"""Putting the parts together from the settings: the one place where names in settings become objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache, partial

from relit_camera.app.demo.demo_files import is_demo_person
from relit_camera.base.config.look import Mode
from relit_camera.base.config.settings import InferenceSettings, RelitSettings, TrackerSettings
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.face_state import Tracker
from relit_camera.face.identity.face_embedder import FaceEmbedder
from relit_camera.face.matting import matting_factory
from relit_camera.face.motion.face_follower import FaceFollower, FaceFollowerSettings
from relit_camera.face.motion.one_euro_filter import FACE_SMOOTHING
from relit_camera.face.tracking.trackers import TRACKERS, TrackerOptions, open_tracker
from relit_camera.live.modes.face_lighting import LitAs
from relit_camera.live.modes.live_mode import LiveMode
from relit_camera.live.modes.mode import ModeContext, ModeFactory, RenderMode
from relit_camera.live.modes.portrait_mode import PortraitMode
from relit_camera.live.modes.ratio_relighting import RatioRelighting, as_large_as_needed
from relit_camera.live.modes.room_light_estimator import RoomLightEstimator
from relit_camera.live.pipeline import Pipeline
from relit_camera.live.publishing.placeholder_image import placeholder
from relit_camera.live.reenactment.dense_motion import DenseMotion
from relit_camera.live.reenactment.reenactor import REENACTORS, ReenactorContext, open_reenactor
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.subject.relighting.relighter import RELIGHTERS, open_relighter
from relit_camera.subject.subject import Subject

OTHER_PERSON_MESSAGE = "this is somebody else's portrait"
"""What the placeholder says in mode portrait where somebody else than the subject is before the camera."""


def session_options(inference: InferenceSettings) -> SessionOptions:
    """How ONNX Runtime shall run every model."""
    return SessionOptions(inference.provider, inference.threads, inference.strict)


open_matting = lru_cache(maxsize=1)(matting_factory)
"""`matting_factory`; recorded mattes, up to a gigabyte, are read once and not by each check and pipeline anew."""


def require_plugins(settings: RelitSettings) -> None:
    """Import the tracker, relighter and reenactor that the settings name, without opening them.

    Sources and sinks are checked by opening them: their names may be files or devices as well.

    Raises:
        NotFoundError: one is not installed; the cure lists those that are.
        ConfigError: several packages have one of that name, or it cannot be imported.
        InputError: one that is built in takes no argument.
    """
    TRACKERS.load(settings.tracker.name)
    RELIGHTERS.load(settings.relight.name)
    REENACTORS.load(settings.reenact.reenactor)


def make_tracker(settings: RelitSettings) -> Tracker:
    """The tracker that the settings name.

    Raises:
        NotFoundError: no such tracker.
        ModelError: its models are missing; `relit models pull` gets them.
        TrackError: `recorded:FILE` names no usable track.
    """
    options = TrackerOptions(session=session_options(settings.inference), blendshapes=False)
    return open_tracker(settings.tracker.name, options)


def make_pipeline(settings: RelitSettings, tracker: Tracker, size: tuple[int, int]) -> Pipeline:
    """The pipeline for an output of `size` (width, height).

    Raises:
        NotFoundError: no relighter, reenactor or matte of the settings' name.
        ConfigError: several packages have a plug-in of that name, or it cannot be imported.
        InputError: `recorded:FILE` names no recorded mattes; or a built-in plug-in takes no argument.
        ImageError: the placeholder picture cannot be read.
    """
    require_plugins(settings)
    session = session_options(settings.inference)
    own_picture = placeholder(size, picture=settings.output.placeholder) if settings.output.placeholder else None
    return Pipeline(
        tracker,
        partial(make_follower, settings.tracker, tracker),
        size,
        mode_factories(settings),
        partial(open_relighter, settings.relight.name, session=session),
        open_matting(settings.matte, session),
        _make_anyone,
        partial(FaceEmbedder, session),
        lambda subject: subject.is_anyone or is_demo_person(subject.metadata),
        partial(placeholder, size, OTHER_PERSON_MESSAGE) if own_picture is None else lambda: own_picture,
    )


def _make_anyone() -> Subject:
    from relit_camera.capture.instant.anyone import anyone  # imports SciPy, which most cameras do without

    return anyone()


def make_follower(settings: TrackerSettings, tracker: Tracker) -> FaceFollower:
    """What smooths the tracker's faces into motion, as the settings say."""
    return FaceFollower(
        tracker.scheme,
        FaceFollowerSettings(
            reach_yaw_deg=settings.reach_yaw_deg,
            reach_pitch_deg=settings.reach_pitch_deg,
            rotation=replace(FACE_SMOOTHING.rotation, dead_band=settings.dead_band_deg),
        ),
    )


def mode_factories(settings: RelitSettings) -> Mapping[Mode, ModeFactory]:
    """How each mode is made for a subject. A new mode is one more entry here."""
    session = session_options(settings.inference)

    def portrait(context: ModeContext) -> RenderMode:
        reenactor = ReenactorContext(context.subject, context.face, context.size, session)
        return PortraitMode(context, open_reenactor(settings.reenact.reenactor, reenactor))

    def lit_as(subject: Subject, face: SourceFace) -> LitAs:
        relighting = RatioRelighting(*as_large_as_needed(subject, face), DenseMotion(session))
        return LitAs(subject, face, relighting, RoomLightEstimator(subject, face))

    return {Mode.LIVE: partial(LiveMode, prepare=lit_as), Mode.PORTRAIT: portrait}
