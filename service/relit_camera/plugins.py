"""The public interface for plug-ins: everything that a package of somebody else's needs, and nothing that may change.

A plug-in is a class or function that a package announces as an entry point of one of these groups; settings then choose
it as `NAME` or `NAME:ARGUMENT`. What it is called with, what it gives, and the setting:

    relit_camera.trackers     TrackerOptions → Tracker               tracker.name, --tracker
    relit_camera.methods      () → ReflectanceMethod                 --method of `relit capture`; no argument
    relit_camera.relighters   Subject, RelighterOptions → Relighter  relight.name
    relit_camera.reenactors   ReenactorContext → Reenactor           reenact.name
    relit_camera.sources      SourceOptions → Source                 source.source, --source
    relit_camera.sinks        SinkOptions → Sink                     output.sink, --sink

Import from here only: the other modules are arranged anew without notice. A plug-in reports what a person can cure by
raising one of the errors; any other exception counts as a fault of the plug-in.
"""

from __future__ import annotations

from relit_camera.base.errors import (
    CaptureError,
    ConfigError,
    DeviceError,
    ImageError,
    InputError,
    LightsError,
    ModelError,
    NotFoundError,
    RelitError,
    StorageError,
    SubjectError,
    TrackError,
    VideoError,
)
from relit_camera.base.images.image_types import DisplayImage, Frame, LinearImage, Mask, Points, RgbaImage
from relit_camera.base.images.tone_mapping import display_from_linear
from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session
from relit_camera.capture.reflectance.method_registry import LinearMethod, ReflectanceMethod, factored_field
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from relit_camera.devices.sinks.sink import Sink, SinkInfo, SinkOptions
from relit_camera.devices.sources.source import Source, SourceInfo, SourceState, ThreadedSource
from relit_camera.devices.sources.source_factory import SourceOptions
from relit_camera.face.face_state import LOST, FaceState, FaceStatus, Tracker
from relit_camera.face.head_pose import HeadPose, fit_pose
from relit_camera.face.landmarks.landmark_schemes import LandmarkScheme, landmark_scheme
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.face.tracking.trackers import TrackerOptions
from relit_camera.light.light_map import LightMap
from relit_camera.live.reenactment.reenactor import Reenactor, ReenactorContext, WarpedLayer, WarpTask
from relit_camera.live.reenactment.source_image import SourceFace
from relit_camera.live.render_quality import RenderQuality
from relit_camera.subject.reflectance_field import ExactField, FactoredField, ReflectanceField
from relit_camera.subject.relighting.relighter import Relighter, RelighterOptions, weighted_light
from relit_camera.subject.subject import Subject

__all__ = [
    "LOST",
    "CaptureError",
    "ConfigError",
    "DeviceError",
    "DisplayImage",
    "ExactField",
    "FaceMotion",
    "FaceState",
    "FaceStatus",
    "FactoredField",
    "Frame",
    "HeadPose",
    "ImageError",
    "InputError",
    "LandmarkScheme",
    "LightMap",
    "LightsError",
    "LinearImage",
    "LinearMethod",
    "Mask",
    "ModelError",
    "NotFoundError",
    "OlatSamples",
    "Points",
    "Reenactor",
    "ReenactorContext",
    "ReflectanceField",
    "ReflectanceMethod",
    "Relighter",
    "RelighterOptions",
    "RelitError",
    "RenderQuality",
    "RgbaImage",
    "Session",
    "SessionOptions",
    "Sink",
    "SinkInfo",
    "SinkOptions",
    "Source",
    "SourceFace",
    "SourceInfo",
    "SourceOptions",
    "SourceState",
    "StorageError",
    "Subject",
    "SubjectError",
    "ThreadedSource",
    "TrackError",
    "Tracker",
    "TrackerOptions",
    "VideoError",
    "WarpTask",
    "WarpedLayer",
    "display_from_linear",
    "factored_field",
    "fit_pose",
    "landmark_scheme",
    "open_session",
    "weighted_light",
]
