"""`python -m relit_studio.mannequin --out DIR`: writes the generated subject and its driving clip.

DIR/olat/        one-light pictures, lights.lp, matte.png, landmarks.json, truth.npz
DIR/clip.mp4     the mannequin in a soft room, 320x320, 24 frames a second
DIR/track.json   the clip's true track, for the tracker `recorded`
DIR/truth.json   the room's light map, and every frame's pose and expression

With --field-rows also DIR/field/, the whole reflectance field: a picture for each texel of a light map of that size.
With --relit NAME also DIR/relit-NAME.mp4, the clip's performance in truth under that built-in environment, and its
DIR/matte.mp4.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from relit_camera.base.errors import RelitError, StorageError
from relit_camera.base.images.contact_sheet import contact_sheet
from relit_camera.base.images.image_files import read_display, write_display
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.atomic_files import make_folder, write_atomic
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.light.environments.builtin.builtin_environments import BUILTIN_NAMES
from relit_camera.light.environments.builtin.builtin_light_maps import builtin_light_map
from relit_studio.mannequin.outputs.driving_clip import CLIP_SIZE, write_clip
from relit_studio.mannequin.outputs.mannequin_field import write_field
from relit_studio.mannequin.outputs.mannequin_performance import FPS, FRAMES, frame_times, posture_at
from relit_studio.mannequin.outputs.olat import write_olat
from relit_studio.mannequin.outputs.relit_clip import write_relit
from relit_studio.mannequin.rendering.distant_lights import room


def generate(
    out: Path,
    size: int,
    lights: int,
    frames: int = FRAMES,
    *,
    field_rows: int = 0,
    relit: Sequence[str] = (),
    quiet: bool = False,
) -> None:
    """Write everything into folder `out`; files of the same names are replaced at the end.

    Args:
        out: made if missing.
        size: of the one-light pictures, pixels.
        lights: how many of them.
        frames: of the clip, from its beginning.
        field_rows: of the light map whose every texel lights a picture of the field; 0 makes no field.
        relit: built-in environments under which the performance is rendered as well.
        quiet: show no progress.

    Raises:
        StorageError: the folder cannot be written.
    """
    make_folder(out)
    try:
        temporary = Path(tempfile.mkdtemp(prefix=".mannequin.", dir=out))
    except OSError as error:
        raise StorageError(f"cannot write in {out}: {error.strerror}", "choose a folder you may write to") from error
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    try:
        with Progress(*columns, console=Console(stderr=True), disable=quiet) as shown:
            task = shown.add_task("one-light pictures", total=lights)
            make_folder(temporary / "olat")
            write_olat(temporary / "olat", size, lights, lambda done, _: shown.update(task, completed=done))
            clip_task = shown.add_task("driving clip", total=frames)
            write_clip(
                temporary / "clip.mp4",
                temporary / "track.json",
                room(),
                frames,
                lambda done, _: shown.update(clip_task, completed=done),
            )
            if field_rows:
                field_task = shown.add_task("field", total=2 * field_rows**2)
                make_folder(temporary / "field")
                write_field(
                    temporary / "field", size, field_rows, lambda done, _: shown.update(field_task, completed=done)
                )
            for name in relit:
                relit_task = shown.add_task(f"relit: {name}", total=frames)
                write_relit(
                    temporary / f"relit-{name}.mp4",
                    temporary / "matte.mp4",
                    builtin_light_map(name),
                    frames,
                    lambda done, _, task=relit_task: shown.update(task, completed=done),  # type: ignore[misc]
                )
        write_atomic(temporary / "truth.json", json.dumps(_truth(frames)))
        write_display(temporary / "sheet.png", _sheet(temporary))
        for name in sorted(path.name for path in temporary.iterdir()):
            target = out / name
            if target.is_dir():
                shutil.rmtree(target)
            (temporary / name).replace(target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _truth(frames: int) -> dict[str, object]:
    postures = [(float(time_s), posture_at(float(time_s))) for time_s in frame_times(frames)]
    return {
        "fps": FPS,
        "size": CLIP_SIZE,
        "light_map": room().round(5).astype(float).tolist(),
        "frames": [
            {"time_s": time_s, "pose": posture.angles._asdict(), "expression": asdict(posture.expression)}
            for time_s, posture in postures
        ],
    }


def _sheet(folder: Path) -> DisplayImage:
    """Six of the one-light pictures over twelve frames of the clip."""
    pictures = [read_display(path) for path in sorted((folder / "olat").glob("[0-9]*.png"))]
    with VideoReader(folder / "clip.mp4") as video:
        frames = [frame.image for frame in video]
    lit = sorted(pictures, key=lambda picture: -float(picture.mean()))[: len(pictures) // 2]
    rows = [_evenly(lit, 6), *(_evenly(half, 6) for half in (frames[: len(frames) // 2], frames[len(frames) // 2 :]))]
    return contact_sheet(rows, ("one light", "clip", ""), cell_width=256)


def _evenly(pictures: Sequence[DisplayImage], count: int) -> list[DisplayImage]:
    return list(pictures[:: max(1, len(pictures) // count)])[:count]


def _within(low: int, high: int) -> Callable[[str], int]:
    def number(text: str) -> int:
        value = int(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{value} is not within {low} and {high}")
        return value

    return number


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 done, 1 it failed with one line on stderr, 2 usage."""
    parser = argparse.ArgumentParser(prog="python -m relit_studio.mannequin", description="Write a generated subject.")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write to")
    parser.add_argument("--size", type=_within(32, 1024), default=192, help="of the one-light pictures, pixels")
    parser.add_argument("--lights", type=_within(4, 999), default=96, help="how many, over the whole sphere")
    parser.add_argument("--frames", type=_within(1, FRAMES), default=FRAMES, help="of the clip, from its beginning")
    parser.add_argument(
        "--field-rows", type=_within(2, 32), default=0, metavar="N", help="also the field, for N x 2N directions"
    )
    parser.add_argument(
        "--relit", action="append", choices=BUILTIN_NAMES, default=[], help="also the true clip under this environment"
    )
    parser.add_argument("--quiet", action="store_true", help="show no progress")
    options = parser.parse_args(arguments)
    try:
        generate(
            options.out, options.size, options.lights, options.frames,
            field_rows=options.field_rows, relit=options.relit, quiet=options.quiet,
        )  # fmt: skip
    except RelitError as error:
        print(f"mannequin: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
