"""`python -m tests.picture_difference OLD_TREE VIDEO SUBJECT`: how far this checkout's pictures are from another's.

Both checkouts render the same scenes from the same film, each in a process of its own. For each scene three figures are
given, PSNR in dB of display codes, the median and the least of the frames: of the whole frame, inside the person and at
the person's edge; and how much more the pictures of a still face flicker. Sheets of the worst frames are written
beside the figures, to be looked at. Run by hand, not in CI; needs the public models.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Frames = NDArray[np.uint8]
"""(count, height, width, 3) sRGB."""

# The modes by their former names: the other checkout may know no others.
SCENES: dict[str, dict[str, object]] = {
    "reenact sunset": {"mode": "reenact", "environment": "sunset", "background": {"kind": "none"}},
    "reenact night-street": {"mode": "reenact", "environment": "night-street", "background": {"kind": "environment"}},
    "reenact studio": {
        "mode": "reenact",
        "environment": "studio",
        "background": {"kind": "color", "color": "#ffffff"},
    },
    "ratio sunset": {"mode": "ratio", "environment": "sunset", "background": {"kind": "none"}},
    "ratio window": {"mode": "ratio", "environment": "window", "background": {"kind": "blur"}},
    "ratio party": {"mode": "ratio", "environment": "party", "background": {"kind": "environment"}},
}
MASK_COLORS = ("#000000", "#ffffff")
"""Backgrounds from whose two pictures the person's alpha follows."""
PERFECT_DB = 99.0


@dataclass(frozen=True)
class Difference:
    """PSNR in dB over the frames of a scene, as (median, least).

    Attributes:
        whole: of the whole frame.
        inside: where the person is opaque.
        edge: within a few pixels of where the person is neither opaque nor absent.
    """

    whole: tuple[float, float]
    inside: tuple[float, float]
    edge: tuple[float, float]


def render_scenes(
    video: Path, subject: Path, tracker: str, size: tuple[int, int], every: int, most: int, out: Path
) -> None:
    """Render all scenes with the `relit_camera` that is imported, into `out`/NAME.npy."""
    from relit_camera.app.wiring import make_pipeline, make_tracker
    from relit_camera.base.concurrency.threads import limit_threads
    from relit_camera.base.config.look import Look
    from relit_camera.base.config.settings import RelitSettings
    from relit_camera.base.images.image_types import Frame
    from relit_camera.base.video.video_readers import VideoReader
    from relit_camera.live.modes.frame_fitting import fit_frame
    from relit_camera.live.scene.scene_controller import SceneController

    limit_threads()
    with VideoReader(video) as reader:
        frames: list[Frame] = [fit_frame(frame, size) for frame, _ in zip(reader, range(most), strict=False)]

    def rendered(mode: str, environment: str, background: dict[str, object]) -> Frames:
        settings = RelitSettings.model_validate({"tracker": {"name": tracker}})
        controller = SceneController(settings.storage)
        controller.load_configured_subject(str(subject))
        controller.set_avatar_allowed(True)
        controller.set_look(
            Look.model_validate(
                {
                    "mode": mode,
                    "background": background,
                    "lighting": {"environment": environment, "transition_s": 0.0},
                }
            )
        )
        pipeline = make_pipeline(settings, make_tracker(settings), size)
        pictures = [pipeline.process(frame, controller.scene).image.copy() for frame in frames]
        return np.stack(pictures[::every])

    for name, scene in SCENES.items():
        np.save(out / f"{name}.npy", rendered(**scene))  # type: ignore[arg-type]
    for mode in ("reenact", "ratio"):
        for color in MASK_COLORS:
            np.save(out / f"mask {mode} {color}.npy", rendered(mode, "studio", {"kind": "color", "color": color}))


def psnr(first: NDArray, second: NDArray) -> float:
    """PSNR in dB of 8-bit codes; `PERFECT_DB` where they are equal."""
    error = float(np.mean((first.astype(np.float32) - second.astype(np.float32)) ** 2)) if first.size else 0.0
    return PERFECT_DB if error == 0 else float(10 * np.log10(255**2 / error))


def person_regions(folder: Path, mode: str) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where the person of a mode's pictures is opaque, and the person's edge, (count, height, width) each."""
    black, white = (np.load(folder / f"mask {mode} {color}.npy", mmap_mode="r") for color in MASK_COLORS)
    through = np.stack([cv2.absdiff(w, b).max(axis=2) for b, w in zip(black, white, strict=True)])
    ring = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    edge = [cv2.dilate(((each > 2) & (each < 253)).astype(np.uint8), ring) > 0 for each in through]
    return (through <= 2) & ~np.stack(edge), np.stack(edge)


def compare(old: Frames, new: Frames, inside: NDArray[np.bool_], edge: NDArray[np.bool_]) -> Difference:
    """The difference of two renderings of a scene."""

    def spread(values: list[float]) -> tuple[float, float]:
        return round(float(np.median(values)), 1), round(min(values), 1)

    frames = range(len(old))
    return Difference(
        spread([psnr(old[i], new[i]) for i in frames]),
        spread([psnr(old[i][inside[i]], new[i][inside[i]]) for i in frames]),
        spread([psnr(old[i][edge[i]], new[i][edge[i]]) for i in frames]),
    )


def still_flicker(frames: Frames) -> float:
    """Mean absolute change from frame to frame in display codes."""
    return float(np.mean([np.mean(cv2.absdiff(a, b)) for a, b in pairwise(frames)]))


def write_sheet(path: Path, old: Frames, new: Frames) -> None:
    """Write old, new and their difference (x8) of the frame that differs most."""
    worst = int(np.argmin([psnr(a, b) for a, b in zip(old, new, strict=True)]))
    difference = cv2.convertScaleAbs(cv2.absdiff(old[worst], new[worst]), alpha=8)
    sheet = np.hstack([old[worst], new[worst], difference])
    cv2.imwrite(str(path), cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR))


def main() -> None:
    """Print JSON, a scene a line, and write sheets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("old_tree", type=Path, help="another checkout of this repository")
    parser.add_argument("video", type=Path, help="a film of the subject's face")
    parser.add_argument("subject", type=Path)
    parser.add_argument("--tracker", default="mesh", help="recorded:FILE where both shall see the same face")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--every", type=int, default=6, help="compare every so many frames")
    parser.add_argument("--frames", type=int, default=144)
    parser.add_argument("--out", type=Path, default=Path("build/picture_difference"))
    parser.add_argument("--render", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    width, height = (int(side) for side in arguments.size.split("x"))
    if arguments.render:
        size, every, most = (width, height), arguments.every, arguments.frames
        render_scenes(arguments.video, arguments.subject, arguments.tracker, size, every, most, arguments.render)
        return
    arguments.out.mkdir(parents=True, exist_ok=True)
    here = Path(__file__).resolve().parents[1]
    with tempfile.TemporaryDirectory() as kept:
        folders = [Path(kept) / "old", Path(kept) / "new"]
        for tree, folder in zip((arguments.old_tree, here), folders, strict=True):
            folder.mkdir()
            environment = {**os.environ, "PYTHONPATH": str(tree.resolve() / "service")}
            command = [sys.executable, __file__, *sys.argv[1:], "--render", str(folder)]
            subprocess.run(command, env=environment, check=True)
        regions = {mode: person_regions(folders[0], mode) for mode in ("reenact", "ratio")}
        for name, scene in SCENES.items():
            inside, edge = regions[str(scene["mode"])]
            old, new = (np.load(folder / f"{name}.npy", mmap_mode="r") for folder in folders)
            found = compare(old, new, inside, edge)
            write_sheet(arguments.out / f"{name.replace(' ', '-')}.png", old, new)
            flicker = still_flicker(new) / max(still_flicker(old), 1e-9)
            print(json.dumps({"scene": name, **found.__dict__, "change_between_frames": round(flicker, 3)}), flush=True)


if __name__ == "__main__":
    main()
