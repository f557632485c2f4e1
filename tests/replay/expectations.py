"""What a case's folder expects, and how what came out differs from it."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.images.image_files import encode_display, read_display
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.rotations import Angles
from relit_camera.base.storage.atomic_files import write_atomic
from tests.replay.case import Case, CaseError, Colours, Pictures, Pose
from tests.replay.play import Played

JPEG_QUALITY = 88
POSE_COLUMNS = ("frame", *Angles._fields)
COLOURS = ("red", "green", "blue")
COLOUR_COLUMNS = ("frame", "part", *COLOURS)


def expected_picture(folder: Path, index: int) -> Path:
    """Where the expected picture of a frame is kept."""
    return folder / "expected" / f"{index:04d}.jpg"


def differences(case: Case, folder: Path, played: Played) -> list[str]:
    """One line for each thing that is not as expected.

    Raises:
        CaseError: an expected file is missing or damaged.
    """
    return [
        *_face(case, played),
        *_pose(case.expect.pose, folder, played),
        *_pictures(case.expect.pictures, folder, played),
        *_colours(case.expect.colours, folder, played),
    ]


def record(case: Case, folder: Path, played: Played) -> list[Path]:
    """Write what came out as what is expected from now on; returns the files."""
    written = []
    if case.expect.pose is not None and case.expect.pose.track is not None:
        path = folder / case.expect.pose.track
        rows = [[index, *(f"{value:.2f}" for value in angles or ())] for index, angles in enumerate(played.angles)]
        _write_table(path, [POSE_COLUMNS, *rows])
        written.append(path)
    if case.expect.pictures is not None:
        _check_frames("pictures", case.expect.pictures.frames, folder, played)
        (folder / "expected").mkdir(exist_ok=True)
        for index in case.expect.pictures.frames:
            path = expected_picture(folder, index)
            write_atomic(path, encode_display(played.relit[index], path.suffix, JPEG_QUALITY))
            written.append(path)
    if case.expect.colours is not None:
        path = folder / case.expect.colours.track
        colours = _mean_colours(case.expect.colours, folder, played).items()
        _write_table(path, [COLOUR_COLUMNS, *([*key, *(f"{v:.4f}" for v in colour)] for key, colour in colours)])
        written.append(path)
    return written


def _face(case: Case, played: Played) -> Iterator[str]:
    if played.found < case.expect.found:
        yield f"the face is found in {played.found:.0%} of the frames, expected are {case.expect.found:.0%}"
    said = "; ".join(f"{trouble.what}: {trouble.why}" for trouble in played.troubles)
    if case.expect.degraded is None and said:
        yield f"reported as degraded: {said}"
    if case.expect.degraded is not None and case.expect.degraded not in said:
        yield f"expected a word about '{case.expect.degraded}', reported was: {said or 'nothing'}"


def _pose(pose: Pose | None, folder: Path, played: Played) -> Iterator[str]:
    if pose is None:
        return
    seen = np.array([angles or (np.nan,) * 3 for angles in played.angles])
    if pose.track is not None:
        expected = read_pose(folder / pose.track)
        if expected.shape != seen.shape:
            yield f"the clip has {len(seen)} frames, {pose.track} {len(expected)}"
        else:
            yield from _far_from(seen, expected, pose.tolerance_deg)
    for axis, name in enumerate(Angles._fields):
        bounds = getattr(pose.bounds, name, None)
        if bounds is not None:
            yield from (
                f"{name} is {value:.1f} degrees in frame {index}, outside of {bounds[0]:g} to {bounds[1]:g}"
                for index, value in enumerate(seen[:, axis])
                if not bounds[0] <= value <= bounds[1]
            )
        jitter = float(np.median(np.abs(np.diff(seen[:, axis], n=2))))
        if pose.jitter_deg is not None and not jitter <= pose.jitter_deg:
            yield f"{name} jitters by {jitter:.2f} degrees from frame to frame, allowed are {pose.jitter_deg:g}"


def _far_from(seen: np.ndarray, expected: np.ndarray, tolerance_deg: float) -> Iterator[str]:
    error = np.abs(seen - expected)
    error[np.isnan(seen) & np.isnan(expected)] = 0
    far = ~(error <= tolerance_deg)
    for axis, name in enumerate(Angles._fields):
        if far[:, axis].any():
            index = int(np.argmax(np.where(np.isnan(error[:, axis]), np.inf, error[:, axis])))
            yield (
                f"{name} differs in {far[:, axis].sum()} frames, most in frame {index}: "
                f"{seen[index, axis]:.2f} degrees, expected {expected[index, axis]:.2f} +-{tolerance_deg:g}"
            )


def _pictures(pictures: Pictures | None, folder: Path, played: Played) -> Iterator[str]:
    if pictures is None:
        return
    _check_frames("pictures", pictures.frames, folder, played)
    for index in pictures.frames:
        expected = _read_expected(folder, index)
        seen = played.relit[index]
        if expected.shape != seen.shape:
            yield f"frame {index} is {seen.shape[1]}x{seen.shape[0]}, expected {expected.shape[1]}x{expected.shape[0]}"
            continue
        quality = psnr(linear_from_uint8(seen), linear_from_uint8(expected))
        if quality < pictures.min_psnr_db:
            yield f"frame {index} is {quality:.1f} dB like the expected one, needed are {pictures.min_psnr_db:g}"


def _colours(colours: Colours | None, folder: Path, played: Played) -> Iterator[str]:
    if colours is None:
        return
    expected = _read_colours(folder / colours.track)
    for (index, part), seen in _mean_colours(colours, folder, played).items():
        if (index, part) not in expected:
            raise CaseError(f"{folder / colours.track} has no {part} in frame {index}; {_cure(folder)}")
        for name, value, right in zip(COLOURS, seen, expected[index, part], strict=True):
            if abs(value - right) > colours.tolerance:
                yield f"{part} in frame {index} has {name} {value:.3f}, expected {right:.3f} +-{colours.tolerance:g}"


def _mean_colours(colours: Colours, folder: Path, played: Played) -> dict[tuple[int, str], np.ndarray]:
    """Mean linear RGB of every part of every frame that is looked at."""
    _check_frames("colours", colours.frames, folder, played)
    means = {}
    for index in colours.frames:
        picture = linear_from_uint8(played.relit[index])
        for part, (left, top, right, bottom) in colours.parts.items():
            pixels = picture[top:bottom, left:right]
            if pixels.shape != (bottom - top, right - left, 3) or not pixels.size:
                raise CaseError(f"{folder.name}: expect.colours.parts.{part} is not within the frames")
            means[index, part] = pixels.mean(axis=(0, 1))
    return means


def _check_frames(field: str, frames: tuple[int, ...], folder: Path, played: Played) -> None:
    beyond = [index for index in frames if index >= len(played.relit)]
    if beyond:
        raise CaseError(f"{folder.name}: expect.{field}.frames has {beyond[0]}, the clip {len(played.relit)} frames")


def _read_expected(folder: Path, index: int) -> DisplayImage:
    path = expected_picture(folder, index)
    if not path.is_file():
        raise CaseError(f"no expected picture {path}; {_cure(folder)}")
    return read_display(path)


def read_pose(path: Path) -> np.ndarray:
    """The pose track of a CSV file: (frames, 3) yaw, pitch, roll in degrees, NaN where no face was followed.

    Raises:
        CaseError: it is missing or not in that form.
    """
    try:
        rows = _read_table(path, POSE_COLUMNS)
        table = np.full((len(rows), 3), np.nan)
        for number, row in enumerate(rows):
            if int(row[0]) != number or len(row) not in (1, 4):
                raise ValueError(f"line {number + 2} must be frame {number} and three angles, or none")
            table[number, : len(row) - 1] = [float(value) for value in row[1:]]
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: {error}; {_cure(path.parent)}") from error
    return table


def _read_colours(path: Path) -> dict[tuple[int, str], tuple[float, ...]]:
    try:
        rows = _read_table(path, COLOUR_COLUMNS)
        return {(int(frame), part): tuple(map(float, colour)) for frame, part, *colour in rows}
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: {error}; {_cure(path.parent)}") from error


def _read_table(path: Path, columns: tuple[str, ...]) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    if not rows or tuple(rows[0]) != columns:
        raise ValueError(f"the first line must be {','.join(columns)}")
    return rows[1:]


def _write_table(path: Path, rows: Iterable[Iterable[object]]) -> None:
    write_atomic(path, "".join(",".join(map(str, row)) + "\n" for row in rows))


def _cure(folder: Path) -> str:
    return f"make it with `python -m tests.replay.record {folder.name}`"
