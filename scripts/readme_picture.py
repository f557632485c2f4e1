"""Draws the README's picture from the demo's videos: `python scripts/readme_picture.py CLIP FOLDER OUT.jpg`.

One row of the driving clip, one for each environment. Of the generated mannequin only: nobody's face is published.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

from relit_camera.compose.sheet import contact_sheet
from relit_camera.space.images import DisplayImage
from relit_camera.video.reader import VideoReader

FRAMES = (4, 20, 36, 56, 68)
ENVIRONMENTS = ("studio", "sunset", "party")
CELL = 180


def frames_of(path: Path) -> list[DisplayImage]:
    """The chosen frames of a video, uint8 sRGB."""
    with VideoReader(path) as video:
        return [frame.image for frame in video if frame.index in FRAMES]


def main() -> None:
    """Draw the picture."""
    clip, folder, out = map(Path, sys.argv[1:])
    rows = [frames_of(clip), *(frames_of(folder / f"{name}.mp4") for name in ENVIRONMENTS)]
    sheet = contact_sheet(rows, ("live", *ENVIRONMENTS), cell_width=CELL)
    out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(out), cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
