"""The files that the demonstration is shipped with. `python -m relit_studio bundle` makes them (docs/studio.md)."""

from __future__ import annotations

from pathlib import Path

from relit_camera.app.setup.needed_models import missing_models

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
    return f"recorded:{TRACK}" if missing_models("mesh") else "mesh"


def matte_of_clip() -> str:
    """The matte `selfie`, or the clip's own mattes where the public networks are not installed."""
    return f"recorded:{MATTES}" if missing_models("", "selfie") else "selfie"
