"""Putting the parts together from the settings: the one place where names of plug-ins become objects."""

from __future__ import annotations

from relit_camera.base.config.settings import InferenceSettings, RelitSettings
from relit_camera.base.models.session_with_fallback import SessionOptions
from relit_camera.face.face_state import Tracker
from relit_camera.face.tracking.trackers import TrackerOptions, open_tracker
from relit_camera.live.compositing.matting import matting_factory
from relit_camera.live.pipeline import Pipeline


def session_options(inference: InferenceSettings) -> SessionOptions:
    """How ONNX Runtime shall run every model."""
    return SessionOptions(inference.provider, inference.threads, inference.strict)


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
    """The picture path for an output of `size` (width, height).

    Raises:
        NotFoundError: no matte of the settings' name.
        InputError: `recorded:FILE` names no recorded mattes.
    """
    options = session_options(settings.inference)
    return Pipeline(
        tracker, size, settings.tracker, settings.reenact, options, matting_factory(settings.matte, options)
    )
