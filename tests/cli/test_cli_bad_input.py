"""Bad input: one clear line on stderr that says what and what to do, exit 1, and nothing left behind."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.images.image_files import write_linear
from relit_camera.cli import main
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.tracking.track_recording import Track, TrackFrame, read_track
from tests.cli.relit_command import (
    COMMAND,
    Answer,
    Material,
    call,
    environment,
    files,
    finish,
    start,
    write_material,
)
from tests.small_camera import wait_until
from tests.synthetic import sphere_samples, write_lights


@pytest.fixture
def lights(tmp_path: Path) -> Path:
    """A small capture of a sphere."""
    return write_lights(tmp_path / "capture", sphere_samples(30, 24))


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    """A folder to write to; at the end nothing may be in it."""
    folder = tmp_path / "out"
    folder.mkdir()
    yield folder
    assert files(folder) == set()


def replay(material: Material, folder: Path, **changes: object) -> Answer:
    """Replay the material into `folder`, with another clip, subject, environment, tracker or result."""
    options = {
        "clip": material.clip, "subject": material.subject, "environment": "studio", "tracker": material.tracker,
        "out": folder / "result.mp4", **changes,
    }  # fmt: skip
    clip = options.pop("clip")
    named = [item for name, value in options.items() for item in (f"--{name}", value)]
    return call("replay", clip, *named, "--report", folder / "report.json")


def relight(subject: Path, folder: Path, **changes: object) -> Answer:
    options = {"out": folder / "picture.png", **changes}
    return call("relight", subject, *[item for name, value in options.items() for item in (f"--{name}", value)])


def edit_line(lights: Path, number: int, text: str) -> None:
    lines = lights.read_text().splitlines()
    lines[number] = text
    lights.write_text("\n".join(lines) + "\n")


# Videos


@pytest.mark.slow
def test_video_without_a_face(material: Material, out: Path, tmp_path: Path) -> None:
    track = read_track(material.track)
    lost = tuple(TrackFrame(time_s=f.time_s, found=False, status=FaceStatus.LOST) for f in track.frames)
    path = tmp_path / "lost.json"
    path.write_text(Track(**{**dict(track), "frames": lost}).model_dump_json())
    replay(material, out, tracker=f"recorded:{path}").complains("no face", str(material.clip), "60 pixels")
    call("track", material.clip, "--out", out / "t.json", "--tracker", f"recorded:{path}").complains("no face")


def test_truncated_video(material: Material, out: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(material.clip.read_bytes()[: material.clip.stat().st_size // 2])
    replay(material, out, clip=cut).complains("cut.mp4")


@pytest.mark.parametrize("content", [b"", b"no video at all" * 100])
def test_file_that_is_no_video(content: bytes, material: Material, out: Path, tmp_path: Path) -> None:
    path = tmp_path / "text.mp4"
    path.write_bytes(content)
    replay(material, out, clip=path).complains("text.mp4")


def test_missing_video(material: Material, out: Path) -> None:
    replay(material, out, clip=out / "none.mp4").complains("none.mp4")


def test_result_that_is_the_clip_itself(material: Material, out: Path) -> None:
    before = material.clip.read_bytes()
    assert replay(material, out, out=material.clip).code == 2
    assert material.clip.read_bytes() == before


def test_result_that_is_no_video_name(material: Material, out: Path) -> None:
    replay(material, out, out=out / "result.txt").complains("result.txt", ".mp4")


# Light


@pytest.mark.parametrize("suffix", [".png", ".exr", ".hdr"])
def test_panorama_that_is_not_two_to_one(suffix: str, material: Material, out: Path, tmp_path: Path) -> None:
    path = tmp_path / f"square{suffix}"
    if suffix == ".hdr":
        cv2.imwrite(str(path), np.ones((64, 64, 3), np.float32))
    else:
        write_linear(path, np.full((64, 64, 3), 0.5, np.float32))
    for answer in (relight(material.subject, out, environment=path), replay(material, out, environment=path)):
        answer.complains("square", "64x64", "twice as wide as high")


@pytest.mark.parametrize(("value", "word"), [(np.nan, "NaN"), (-1.0, "negative"), (np.inf, "inf")])
def test_panorama_of_impossible_light(value: float, word: str, material: Material, out: Path, tmp_path: Path) -> None:
    picture = np.ones((32, 64, 3), np.float32)
    picture[3, 4, 1] = value
    path = tmp_path / "broken.exr"
    write_linear(path, picture)
    answer = relight(material.subject, out, environment=path)
    answer.complains("broken.exr")
    assert word.lower() in answer.err.lower()


def test_damaged_hdr(material: Material, out: Path, tmp_path: Path) -> None:
    path = tmp_path / "sky.hdr"
    cv2.imwrite(str(path), np.ones((32, 64, 3), np.float32))
    path.write_bytes(path.read_bytes()[:100])
    relight(material.subject, out, environment=path).complains("sky.hdr")


def test_unknown_environment_names_close_ones(material: Material, out: Path) -> None:
    relight(material.subject, out, environment="stuido").complains("stuido", "studio")
    replay(material, out, environment="sunst").complains("sunst", "sunset")


@pytest.mark.parametrize(("option", "value"), [("exposure-ev", "99"), ("exposure-ev", "5000"), ("rotate", "999,0,0")])
def test_light_out_of_range_is_usage(option: str, value: str, material: Material, out: Path) -> None:
    answers = [replay(material, out, **{option: value})]
    if option == "exposure-ev":
        answers.append(relight(material.subject, out, light="0,0", **{option: value}))
    for answer in answers:
        assert answer.code == 2
        assert "Traceback" not in answer.err


@pytest.mark.parametrize("text", ["90", "left,up", "1,2,3", "nan,0", ""])
def test_light_that_is_not_two_numbers_is_usage(text: str, material: Material, out: Path) -> None:
    answer = relight(material.subject, out, light=text)
    assert answer.code == 2
    assert "--light" in answer.err
    assert "Traceback" not in answer.err


# Captures


def test_lights_file_naming_a_missing_picture(lights: Path, out: Path) -> None:
    (lights.parent / "007.png").unlink()
    call("capture", "import", lights, "--out", out / "s.relit").complains("007.png", "line 9")


def test_pictures_of_two_sizes(lights: Path, out: Path) -> None:
    cv2.imwrite(str(lights.parent / "005.png"), np.zeros((20, 24, 3), np.uint8))
    call("capture", "import", lights, "--out", out / "s.relit").complains("005.png", "24x20", "24x24")


@pytest.mark.parametrize(
    ("direction", "length"), [("0 0 0", "length 0"), ("0 0 1.2", "length 1.2"), ("0 1 1", "1.414")]
)
def test_direction_that_is_not_a_unit_vector(direction: str, length: str, lights: Path, out: Path) -> None:
    edit_line(lights, 3, f"002.png {direction}")
    call("capture", "import", lights, "--out", out / "s.relit").complains("line 4", length)


@pytest.mark.parametrize(
    ("line", "text", "word"),
    [(0, "31", "announces 31"), (0, "many", "count"), (2, "001.png 0 nan 1", "x y z"), (2, "001.png 0 1", "x y z")],
)
def test_malformed_lights_file(line: int, text: str, word: str, lights: Path, out: Path) -> None:
    edit_line(lights, line, text)
    call("capture", "import", lights, "--out", out / "s.relit").complains(str(lights), word)


def test_damaged_picture_of_a_capture(lights: Path, out: Path) -> None:
    (lights.parent / "004.png").write_bytes(b"\x89PNG\r\n\x1a\n and nothing more")
    call("capture", "import", lights, "--out", out / "s.relit").complains("004.png")


def test_missing_lights_file_and_unknown_method(lights: Path, out: Path) -> None:
    call("capture", "import", lights.parent / "none.lp", "--out", out / "s.relit").complains("none.lp")
    call("capture", "import", lights, "--out", out / "s.relit", "--method", "magic").complains("magic", "barycentric")
    call("capture", "import", lights, "--out", out / "s.relit", "--gamma", "purple").complains("purple", "srgb")


# Subjects


def cut_off(data: bytes) -> bytes:
    return data[: len(data) // 2]


def of_version_99(data: bytes) -> bytes:
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    meta = header["__metadata__"]
    for key, value in meta.items():
        if value.startswith("{"):
            meta[key] = json.dumps({**json.loads(value), "format_version": 99, "version": 99})
        elif "version" in key:
            meta[key] = "99"
    changed = json.dumps(header).encode()
    return len(changed).to_bytes(8, "little") + changed + data[8 + length :]


@pytest.mark.parametrize("damage", [cut_off, of_version_99, lambda data: b"", lambda data: b"no subject" * 50])
def test_damaged_subject(damage: object, material: Material, out: Path, tmp_path: Path) -> None:
    assert callable(damage)
    path = tmp_path / "damaged.relit"
    path.write_bytes(damage(material.subject.read_bytes()))
    relight(path, out, light="0,0").complains("damaged.relit")
    replay(material, out, subject=path).complains("damaged.relit")
    call("subject", "info", path).complains("damaged.relit")


def test_missing_subject(material: Material, out: Path) -> None:
    relight(out / "nobody.relit", out, light="0,0").complains("nobody")
    replay(material, out, subject="nobody").complains("nobody", "there are")


# Tracks and models


def test_track_of_another_video(material: Material, out: Path, tmp_path: Path) -> None:
    path = tmp_path / "other.json"
    path.write_text(material.track.read_text().replace('"size":[128,96]', '"size":[640,480]'))
    replay(material, out, tracker=f"recorded:{path}").complains("640x480", "128x96")


@pytest.mark.parametrize("text", ["{}", "[", ""])
def test_damaged_track(text: str, material: Material, out: Path, tmp_path: Path) -> None:
    path = tmp_path / "damaged.json"
    path.write_text(text)
    replay(material, out, tracker=f"recorded:{path}").complains("damaged.json", "relit track")


def test_unknown_tracker(material: Material, out: Path) -> None:
    replay(material, out, tracker="mehs").complains("mehs", "mesh")


def test_missing_model(material: Material, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RELIT_MODELS_DIR", str(out))
    replay(material, out, tracker="mesh").complains("relit models pull")


def test_model_with_the_wrong_sha256(out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mirror, store = tmp_path / "mirror", tmp_path / "store"
    mirror.mkdir()
    monkeypatch.setenv("RELIT_MODELS_DIR", str(store))
    (mirror / "face_detection_yunet_2023mar.onnx").write_bytes(b"another model")
    answer = call("models", "pull", "face_detector_yunet", "--from", mirror)
    answer.complains("face_detection_yunet_2023mar.onnx", "sha256")
    left = {name for name in files(store) if not name.endswith(".lock")} if store.exists() else set()
    assert left <= {"downloads"}
    call("models", "pull", "face_detector_yunet", "--from", tmp_path / "none").complains("none")


# Where results go


@pytest.mark.slow
def test_folder_that_does_not_exist(material: Material, out: Path, lights: Path) -> None:
    for answer in (
        relight(material.subject, out, light="0,0", out=out / "new" / "x.png"),
        replay(material, out, out=out / "new" / "x.mp4"),
        call("capture", "import", lights, "--out", out / "new" / "s.relit"),
        call("track", material.clip, "--out", out / "new" / "t.json", "--tracker", material.tracker),
    ):
        answer.complains(str(out / "new"), "create the folder first")


def test_a_side_result_that_cannot_be_written_leaves_no_video(material: Material, out: Path) -> None:
    named = ("--subject", material.subject, "--environment", "studio", "--tracker", material.tracker)
    into = ("replay", material.clip, *named, "--out", out / "x.mp4")
    call(*into, "--report", out / "new" / "r.json").complains(str(out / "new"), "create the folder first")
    call(*into, "--contact-sheet", out / "new" / "s.png").complains(str(out / "new"), "create the folder first")
    assert call(*into, "--contact-sheet", out / "s.gif").code == 2


def test_bench_says_what_is_missing_before_it_measures(out: Path) -> None:
    call("bench", "--environments", out / "none").complains("none")
    call("bench", "--video", out / "none.mp4").complains("none.mp4")


@pytest.mark.slow
def test_a_command_told_to_end_leaves_nothing(out: Path, tmp_path: Path) -> None:
    long = write_material(tmp_path, frames=400)
    process = start(
        "replay", long.clip, "--subject", long.subject, "--environment", "studio", "--tracker", long.tracker,
        "--out", out / "x.mp4", folder=tmp_path,
    )  # fmt: skip
    wait_until(lambda: bool(files(out)) or process.poll() is not None, 60)
    process.terminate()
    assert process.communicate(timeout=30) == ("", "")
    assert process.returncode == 143


@pytest.mark.parametrize(("raised", "status"), [(SystemExit(143), 143), (KeyboardInterrupt(), 130)])
def test_told_to_end_while_a_library_is_imported(
    raised: BaseException, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The library says that its import failed, because of what the signal raised (as pybind11 does)."""

    def import_fails() -> None:
        raise ImportError("initialization failed") from raised

    monkeypatch.setattr(main, "app", import_fails)
    assert call("bench") == Answer(status, "", "")


def test_an_import_that_fails_by_itself_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    def import_fails() -> None:
        raise ImportError("initialization failed") from OSError("no such library")

    monkeypatch.setattr(main, "app", import_fails)
    with pytest.raises(ImportError):
        call("bench")


def test_folder_that_cannot_be_written(material: Material, out: Path) -> None:
    if os.geteuid() == 0:
        place = Path("/proc/relit")
        answer = relight(material.subject, out, light="0,0", out=place / "x.png")
    else:
        out.chmod(0o500)
        answer = relight(material.subject, out, light="0,0")
        out.chmod(0o700)
    answer.complains("cannot write")


def test_result_that_is_a_folder(material: Material, out: Path, tmp_path: Path) -> None:
    folder = tmp_path / "picture.png"
    folder.mkdir()
    relight(material.subject, out, light="0,0", out=folder).complains("picture.png", "folder")
    assert files(folder) == set()


def test_name_that_is_too_long(material: Material, out: Path) -> None:
    """No file system takes more than 255 bytes; the letters here have two each."""
    name = "ä" * 126
    written = relight(material.subject, out, light="0,0", out=out / f"{name}.png")
    written.complains("cannot write", "File name too long", "shorter")
    for answer in (
        replay(material, out, clip=f"{name}.mp4"),
        replay(material, out, environment=f"{name}.hdr"),
        relight(Path(f"{name}.relit"), out, light="0,0"),
        call("config", "check", f"{name}.yaml"),
    ):
        answer.complains(name, "too long", "shorter")


@pytest.fixture
def full_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 kB, where this user may mount one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    if mount is None or os.geteuid() != 0:
        pytest.skip("mounting a small disk needs root")
    made = subprocess.run(
        [mount, "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)], capture_output=True, check=False
    )
    if made.returncode:
        pytest.skip("no small disk can be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
def test_full_disk(full_disk: Path, material: Material, lights: Path) -> None:
    (full_disk / "filler").write_bytes(bytes(60 << 10))
    for answer in (
        call("capture", "import", lights, "--out", full_disk / "s.relit"),
        replay(material, full_disk, out=full_disk / "x.mp4"),
        call("track", material.clip, "--out", full_disk / "t.json", "--tracker", material.tracker),
    ):
        answer.complains("cannot write", "No space left", "free some space")
    assert files(full_disk) == {"filler"}


def without_coverage(variables: dict[str, str]) -> dict[str, str]:
    """The environment without what makes a process measure line coverage, whose file would be too large as well."""
    return {name: value for name, value in variables.items() if not name.startswith("COVERAGE_")}


@pytest.mark.slow
def test_file_size_limit_stands_for_a_full_disk(material: Material, out: Path, tmp_path: Path) -> None:
    """Where no disk can be mounted: the kernel refuses to let a file grow, as a full disk does."""
    limit = 20_000

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    done = subprocess.run(
        [*COMMAND, "track", str(material.clip), "--out", str(out / "t.json"), "--tracker", material.tracker],
        env=without_coverage(environment(tmp_path)), preexec_fn=limited, capture_output=True, text=True, timeout=60,
        check=False,
    )  # fmt: skip
    Answer(done.returncode, done.stdout, done.stderr).complains("cannot write", "t.json", "File too large")


def test_an_existing_result_stays_when_a_command_fails(material: Material, tmp_path: Path) -> None:
    kept = tmp_path / "result.mp4"
    kept.write_bytes(b"precious")
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(cut_off(material.clip.read_bytes()))
    assert replay(material, tmp_path, clip=cut).code == 1
    assert kept.read_bytes() == b"precious"


def test_settings_at_fault(material: Material, out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = tmp_path / "config.yaml"
    config.write_text("output:\n  widht: 640\n")
    answer = call("--config", config, "relight", material.subject, "--light", "0,0", "--out", out / "x.png")
    answer.complains("config.yaml line 2", "widht")
    monkeypatch.setenv("RELIT_OUTPUT__FPS", "1000")
    relight(material.subject, out, light="0,0").complains("output.fps")


@pytest.mark.slow
def test_a_process_says_the_same(material: Material, out: Path, tmp_path: Path) -> None:
    finish("relight", tmp_path / "nobody.relit", "--light", "0,0", "--out", out / "x.png", folder=tmp_path).complains(
        "nobody"
    )
