"""The files that the demonstration is shipped with. `python -m relit_studio bundle` makes them (docs/studio.md)."""

from __future__ import annotations

from pathlib import Path

from relit_camera.base.errors import ModelError
from relit_camera.base.models.model_store import model_path

FOLDER = Path(__file__).parent / "data"
SUBJECT = FOLDER / "adam.relit"
CLIP = FOLDER / "clip.mp4"
TRACK = FOLDER / "track.json"
"""What was so in each frame of the clip: it drives where no public face tracker is installed."""
MATTES = FOLDER / "mattes.npz"
"""Where the person is in each frame: used where no public matting network is installed."""
CREDITS = FOLDER / "CREDITS.md"


def tracker_of_clip() -> str:
    """The tracker `mesh`, or the clip's own track where the public networks are not installed."""
    return "mesh" if _installed("face_mesh", "face_detector_yunet") else f"recorded:{TRACK}"


def matte_of_clip() -> str:
    """The matte `selfie`, or the clip's own mattes where the public networks are not installed."""
    return "selfie" if _installed("selfie_landscape", "selfie_square") else f"recorded:{MATTES}"


def _installed(*models: str) -> bool:
    try:
        return all(model_path(name) for name in models)
    except ModelError:
        return False
