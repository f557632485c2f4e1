"""The files that the demonstration is shipped with. `python -m relit_studio bundle` makes them (docs/studio.md)."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent / "data"
SUBJECT = FOLDER / "adam.relit"
CLIP = FOLDER / "clip.mp4"
TRACK = FOLDER / "track.json"
"""What was so in each frame of the clip: it drives where no public face tracker is installed."""
MATTES = FOLDER / "mattes.npz"
"""Where the person is in each frame: used where no public matting network is installed."""
CREDITS = FOLDER / "CREDITS.md"
