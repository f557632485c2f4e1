"""The form of a case: what is refused, what a failing run leaves, and how expectations are refreshed."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.app.replay.video_replay import ReplayedFrame
from relit_camera.base.config.look import Mode
from relit_camera.base.images.image_files import read_display
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.face.face_state import FaceStatus
from relit_camera.face.motion.face_follower import FaceMotion
from relit_camera.live.publishing.what_is_shown import Shown
from tests.replay.case import CASES, Case, CaseError, read_case
from tests.replay.expectations import differences, read_pose, record
from tests.replay.failures import keep
from tests.replay.materials import UnavailableError, find, shared_folder
from tests.replay.play import Played

LEAST = {
    "description": "d", "clip": "c.mp4", "subject": "s.relit", "environment": "studio", "mode": "portrait",
    "tracker": "mesh", "expect": {},
}  # fmt: skip
EXPECTED_PICTURES = {"expect": {"pictures": {"frames": [1, 3], "min_psnr_db": 40}}}


def case_of(**changes: object) -> Case:
    return Case.model_validate({**LEAST, **changes})


def played(count: int = 4, shade: int = 100) -> Played:
    """Pictures with a bright square that moves, and no face."""
    pictures = []
    for index in range(count):
        picture = np.full((48, 64, 3), shade, np.uint8)
        picture[8:24, 8 + 4 * index : 24 + 4 * index] = 230
        pictures.append(picture)
    frames = [ReplayedFrame(index, index / 24, None, Shown.RELIT, {}) for index in range(count)]
    return Played(frames, pictures, pictures, [])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("clip: [", "is no YAML"),
        ("just words", "the file"),
        ("mode: portrait", "clip: Field required"),
        ("modus: portrait", "modus: Extra inputs are not permitted"),
        ("mode: dance", "mode: Input should be 'live' or 'portrait'"),
        ("expect: {pose: {bounds: {yaw: [30, -30]}}}", "yaw: the lower bound comes first"),
        ("expect: {pictures: {frames: []}}", "expect.pictures.frames"),
        ("expect: {pictures: {frames: [3], min_psnr_db: .nan}}", "expect.pictures.min_psnr_db"),
        ("expect: {found: 1.5}", "expect.found"),
        ("expect: {colours: {track: c.csv, frames: [1], parts: {}}}", "expect.colours.parts"),
        ("expect: {colours: {track: c.csv, frames: [1], parts: {nose: [1, 2, 3]}}}", "expect.colours.parts.nose"),
    ],
)
def test_wrong_case_names_file_and_field(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "case.yaml").write_text(text)
    with pytest.raises(CaseError) as error:
        read_case(tmp_path)
    assert str(tmp_path / "case.yaml") in str(error.value)
    assert said in str(error.value)


def test_former_names_of_modes_are_read() -> None:
    assert [case_of(mode=former).mode for former in ("ratio", "reenact")] == [Mode.LIVE, Mode.PORTRAIT]


def test_folder_without_case(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match="cannot read"):
        read_case(tmp_path)


def test_shipped_cases_need_nothing_or_say_so() -> None:
    assert not read_case(CASES / "mannequin-portrait").uses_shared
    assert not read_case(CASES / "mannequin-live").uses_shared
    assert read_case(CASES / "adam-live").uses_shared


def test_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find("clips/a.mp4", tmp_path, "") == tmp_path / "clips" / "a.mp4"
    assert find(str(tmp_path / "b.mp4"), Path("elsewhere"), "") == tmp_path / "b.mp4"
    monkeypatch.setenv("RELIT_SHARED", str(tmp_path / "nowhere"))
    with pytest.raises(UnavailableError, match="RELIT_SHARED"):
        shared_folder()


def test_what_was_recorded_is_as_expected(tmp_path: Path) -> None:
    case = case_of(**EXPECTED_PICTURES)
    written = record(case, tmp_path, played())
    assert [path.name for path in written] == ["0001.jpg", "0003.jpg"]
    assert all(path.stat().st_size < 40_000 for path in written)
    assert differences(case_of(expect={"found": 0, **EXPECTED_PICTURES["expect"]}), tmp_path, played()) == []


def test_other_pictures_are_told_and_kept_beside_the_expected(tmp_path: Path) -> None:
    folder = tmp_path / "my-case"
    folder.mkdir()
    case = case_of(expect={"found": 0, **EXPECTED_PICTURES["expect"]})
    record(case, folder, played())
    darker = played(shade=80)
    wrong = differences(case, folder, darker)
    assert len(wrong) == 2
    assert wrong[0].startswith("frame 1 is")
    told = keep(case, folder, darker, wrong, tmp_path / "failures")
    kept = tmp_path / "failures" / "my-case"
    assert str(kept / "sheet.png") in told
    assert wrong[0] in told
    names = sorted(path.name for path in kept.iterdir())
    assert names == [
        "0001-expected.jpg", "0001-seen.png", "0003-expected.jpg", "0003-seen.png", "report.json", "sheet.png",
    ]  # fmt: skip
    np.testing.assert_array_equal(read_display(kept / "0001-seen.png"), darker.relit[1])


def test_pictures_of_another_size(tmp_path: Path) -> None:
    case = case_of(expect={"found": 0, **EXPECTED_PICTURES["expect"]})
    record(case, tmp_path, played())
    small = played()
    small = Played(small.frames, small.live, [cv2.resize(p, (32, 24)) for p in small.relit], [])
    assert "frame 1 is 32x24, expected 64x48" in differences(case, tmp_path, small)


def coloured(frames: tuple[int, ...] = (1, 3), **parts: list[int]) -> Case:
    colours = {"track": "colours.csv", "frames": frames, "parts": parts or {"face": [8, 8, 24, 24]}}
    return case_of(expect={"found": 0, "colours": colours})


def test_a_wrong_colour_is_named_with_part_and_frame(tmp_path: Path) -> None:
    case = coloured()
    run = played()
    assert [path.name for path in record(case, tmp_path, run)] == ["colours.csv"]
    assert differences(case, tmp_path, run) == []
    tinted = [picture * np.array([1, 1, 0.5]) for picture in run.relit]
    wrong = differences(case, tmp_path, Played(run.frames, run.live, [p.astype(np.uint8) for p in tinted], []))
    assert [line.split(" has ")[0] for line in wrong] == ["face in frame 1", "face in frame 3"]
    assert all("has blue" in line for line in wrong)
    # The mean of the square and what is beside it, in linear light.
    row = (tmp_path / "colours.csv").read_text().splitlines()[1].split(",")
    bright, dark = 0.7913, 0.1274  # 230 and 100 under the sRGB curve
    assert row[:2] == ["1", "face"]
    assert float(row[2]) == pytest.approx(0.75 * bright + 0.25 * dark, abs=1e-3)


def test_colours_that_cannot_be_compared(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"No such file.*tests\.replay\.record"):
        differences(coloured(), tmp_path, played())
    record(coloured(), tmp_path, played())
    with pytest.raises(CaseError, match="no chin in frame 1"):
        differences(coloured(chin=[0, 0, 8, 8]), tmp_path, played())
    with pytest.raises(CaseError, match=r"colours\.frames has 9, the clip 4 frames"):
        differences(coloured((9,)), tmp_path, played())
    for beyond in ([0, 0, 65, 8], [8, 8, 8, 16], [16, 8, 8, 16]):
        with pytest.raises(CaseError, match=r"parts\.face is not within"):
            differences(coloured(face=beyond), tmp_path, played())


def test_missing_expectations_say_how_to_make_them(tmp_path: Path) -> None:
    case = case_of(**EXPECTED_PICTURES)
    with pytest.raises(CaseError, match=r"python -m tests\.replay\.record"):
        differences(case, tmp_path, played())
    with pytest.raises(CaseError, match="has 3, the clip 2 frames"):
        differences(case, tmp_path, played(count=2))


def test_no_face_and_no_word(tmp_path: Path) -> None:
    wrong = differences(case_of(expect={"degraded": "live"}), tmp_path, played())
    assert wrong == [
        "the face is found in 0% of the frames, expected are 100%",
        "expected a word about 'live', reported was: nothing",
    ]


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (lambda text: text.replace("frame,yaw", "yaw"), "the first line must be"),
        (lambda text: text.replace("\n1,", "\n7,"), "line 3 must be frame 1"),
        (lambda text: text.replace("\n1,", "\n1,a"), "could not convert"),
    ],
)
def test_damaged_pose_track(changed: object, said: str, tmp_path: Path) -> None:
    assert callable(changed)
    shutil.copy(CASES / "mannequin-portrait" / "pose.csv", tmp_path)
    path = tmp_path / "pose.csv"
    assert read_pose(path).shape == (48, 3)
    path.write_text(changed(path.read_text()))
    with pytest.raises(CaseError) as error:
        read_pose(path)
    assert said in str(error.value)


def followed(poses: np.ndarray) -> Played:
    """A run whose head had these poses, (frames, 3) degrees."""
    rest, none = np.zeros(3), np.zeros((0, 3))
    motions = [
        FaceMotion(
            FaceStatus.FOUND, 1.0, rotation_from_angles(*pose), rest, none, none[:, :2].astype(np.float32), None, None
        )
        for pose in poses
    ]
    return Played([ReplayedFrame(i, i / 24, motion, Shown.RELIT, {}) for i, motion in enumerate(motions)], [], [], [])


def test_a_turned_pose_is_found_and_named(tmp_path: Path) -> None:
    seen = followed(read_pose(CASES / "mannequin-portrait" / "pose.csv"))
    case = case_of(expect={"pose": {"track": "pose.csv", "tolerance_deg": 0.5}})
    record(case, tmp_path, seen)
    assert differences(case, tmp_path, seen) == []
    lines = (tmp_path / "pose.csv").read_text().splitlines()
    lines[21] = "20,-60.00,0.00,0.00"
    (tmp_path / "pose.csv").write_text("\n".join(lines) + "\n")
    wrong = differences(case, tmp_path, seen)
    assert any("yaw differs in 1 frames, most in frame 20" in line for line in wrong), wrong


def test_bounds_and_jitter(tmp_path: Path) -> None:
    seen = followed(read_pose(CASES / "mannequin-portrait" / "pose.csv"))
    bounded = case_of(expect={"pose": {"bounds": {"yaw": [-5, 5]}, "jitter_deg": 0.01}})
    wrong = differences(bounded, tmp_path, seen)
    assert any(line.startswith("yaw is ") for line in wrong)
    assert any(line.startswith("yaw jitters by") for line in wrong)
