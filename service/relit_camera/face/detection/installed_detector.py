"""Opens the face detector that is installed."""

from __future__ import annotations

from relit_camera.base.models.model_store import installed_model, model_path
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.face.detection.blaze_face_detector import BlazeFaceDetector
from relit_camera.face.detection.face_detector import FaceDetector
from relit_camera.face.detection.yunet_detector import YuNetDetector

DETECTORS = ("face_detector_yunet", "face_detector_short_range")
"""The first one that is installed is used."""


def open_face_detector(options: SessionOptions | None = None) -> FaceDetector:
    """Open YuNet, which finds far faces too, or else BlazeFace.

    Raises:
        ModelError: neither is installed, or it cannot be used.
    """
    name = installed_model(DETECTORS) or DETECTORS[0]
    if name == "face_detector_yunet":
        return YuNetDetector(model_path(name))
    return BlazeFaceDetector(open_session(model_path(name), name, options))
