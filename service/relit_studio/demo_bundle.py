"""The files that `relit demo` ships with, made from one person's rendered field and driving video."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2

from relit_camera.app.captures.expression_capture import capture_expressions
from relit_camera.app.demo import demo_files
from relit_camera.base.errors import InputError
from relit_camera.base.images.image_types import Mask
from relit_camera.base.storage.atomic_files import atomic_path, make_folder, write_atomic
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.reflectance.method_registry import DEFAULT_METHOD
from relit_camera.capture.subject_builder import build_subject
from relit_camera.capture.subject_landmarks import read_landmarks
from relit_camera.face.matte_files import write_mattes
from relit_camera.face.tracking.track_recording import read_track
from relit_camera.subject.compression.webp_packing import pack_subject
from relit_camera.subject.subject_file import read_subject, write_stills, write_subject
from relit_studio.base.progress import Progress, no_progress
from relit_studio.cycles.exr import read_rgba

MAX_BYTES = {demo_files.SUBJECT.name: 8_000_000, demo_files.CLIP.name: 4_000_000}
_MATTE_SHRINK = 2


def make_bundle(
    field: Path,
    clip: Path,
    out: Path,
    components: int,
    progress: Progress = no_progress,
    expressions: Path | None = None,
) -> list[Path]:
    """Write the demonstration's files into `out` and return them.

    Args:
        field: folder of `field`, rendered with Cycles.
        clip: folder of `drive`, of the same person.
        out: folder to write to.
        components: principal pictures that the subject keeps.
        progress: told of the field's pictures as they are read.
        expressions: another folder of `drive`, of which the subject gets expression stills; none without.

    Raises:
        InputError: a folder is not finished, or the person is not the same in all.
        LightsError, ImageError, TrackError: a file in it is damaged.
        CaptureError, ModelError: no stills can be made.
        StorageError: a file cannot be written.
    """
    for folder in (clip, expressions):
        if folder is not None:
            _check_same_person(field / "field.json", folder / "drive.json")
    frames = _frames(clip, len(read_track(clip / demo_files.TRACK.name).frames))
    make_folder(out)
    with TemporaryDirectory(prefix=".bundle.", dir=out) as name:
        made = _write(field, clip, frames, Path(name), components, progress)
        if expressions is not None:
            _add_stills(made[0], _existing(expressions / demo_files.CLIP.name))
        for path in made:
            max_bytes = MAX_BYTES.get(path.name)
            if max_bytes and path.stat().st_size > max_bytes:
                raise InputError(
                    f"{path.name} would have {path.stat().st_size / 1e6:.1f} MB; it may have {max_bytes / 1e6:.0f}",
                    "keep fewer components, or render smaller pictures",
                )
        return [path.replace(out / path.name) for path in made]


def _write(
    field: Path, clip: Path, frames: list[Path], folder: Path, components: int, progress: Progress
) -> list[Path]:
    """Write all files into `folder`."""
    made = [
        folder / path.name
        for path in (demo_files.SUBJECT, demo_files.CLIP, demo_files.TRACK, demo_files.MATTES, demo_files.CREDITS)
    ]
    subject_file, clip_file, track_file, mattes_file, credits_file = made
    samples = import_samples(field / "lights.lp", "linear", progress)
    points = read_landmarks(field / "landmarks.json", required=True)
    subject = build_subject(samples, DEFAULT_METHOD, "lights.lp", "linear", points)
    write_subject(subject_file, pack_subject(subject, components), small=True)
    shutil.copyfile(_existing(clip / demo_files.CLIP.name), clip_file)
    # Round to a thousandth of a pixel, degree or centimeter.
    text = (clip / demo_files.TRACK.name).read_text(encoding="utf-8")
    track = json.loads(text, parse_float=lambda number: round(float(number), 3))
    write_atomic(track_file, json.dumps(track, separators=(",", ":")) + "\n")
    write_mattes(mattes_file, [_matte(path) for path in frames])
    lines = json.loads(_existing(clip / "truth.json").read_text(encoding="utf-8"))["credits"]
    write_atomic(credits_file, _credits_text(lines))
    return made


def _add_stills(subject: Path, film: Path) -> None:
    """Give the subject in a file the expression stills of a film of that person."""
    stills = capture_expressions(film, read_subject(subject)).stills
    with atomic_path(subject) as path:
        write_stills(subject, path, stills)


def _check_same_person(field: Path, drive: Path) -> None:
    names = [json.loads(_existing(path).read_text(encoding="utf-8"))["person"]["name"] for path in (field, drive)]
    if names[0] != names[1]:
        raise InputError(f"{field} is of {names[0]}, and {drive} of {names[1]}", "render both of one person")


def _existing(path: Path) -> Path:
    if not path.is_file():
        raise InputError(f"there is no {path}", "render the folder to its end with `field` or `drive` first")
    return path


def _frames(clip: Path, count: int) -> list[Path]:
    paths = sorted((clip / "frames").glob("*.exr"))
    if len(paths) != count:
        raise InputError(f"{clip} has {len(paths)} frames, its track {count}", "run `drive` again to its end")
    return paths


def _matte(path: Path) -> Mask:
    """Matte of one frame, at half its size."""
    _, alpha = read_rgba(path)
    height, width = alpha.shape
    small: Mask = cv2.resize(alpha, (width // _MATTE_SHRINK, height // _MATTE_SHRINK), interpolation=cv2.INTER_AREA)
    return small


def _credits_text(lines: list[str]) -> str:
    listed = "\n".join(f"- {line}" for line in lines)
    return (
        "# Credits\n\nThe person in this folder does not exist: they were rendered from\n\n"
        f"{listed}\n\nThe pictures are changed much: fitted to one another, recoloured, given hair, eyes and clothes.\n"
        "ICT-FaceKit: https://github.com/ICT-VGL/ICT-FaceKit. The scan: https://www.ir-ltd.net, under\n"
        "https://creativecommons.org/licenses/by/3.0/. Whoever passes these files on keeps this page with them.\n"
    )
