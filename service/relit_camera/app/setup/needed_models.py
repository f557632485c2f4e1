"""Which public models the tracker and the matte of the settings need, and which of them are missing."""

from __future__ import annotations

from collections.abc import Mapping

from relit_camera.base.models.model_store import ModelStore, installed_model
from relit_camera.face.detection.installed_detector import DETECTORS
from relit_camera.face.matting import LANDSCAPE_MODEL, SQUARE_MODEL
from relit_camera.face.tracking.mediapipe_mesh_tracker import MESHES

OF_TRACKER: Mapping[str, tuple[tuple[str, ...], ...]] = {
    "mesh": (MESHES, DETECTORS),
    "openseeface": (("openseeface",), DETECTORS),
}
"""Models without which a tracker does not open, one of each group. `recorded` needs none; a plug-in checks its own when
it opens."""

OF_MATTE: Mapping[str, tuple[tuple[str, ...], ...]] = {"selfie": ((LANDSCAPE_MODEL,), (SQUARE_MODEL,))}
"""The same of a matte."""


def missing_models(tracker: str, matte: str = "") -> list[str]:
    """Name the models that a tracker or matte, `NAME` or `NAME:ARGUMENT`, needs and that are not stored, or damaged."""
    groups = (*OF_TRACKER.get(tracker.partition(":")[0], ()), *OF_MATTE.get(matte.partition(":")[0], ()))
    store = ModelStore()
    installed = {group: installed_model(group) for group in groups}
    return [group[0] for group, name in installed.items() if name is None or not store.is_pulled(name)]
