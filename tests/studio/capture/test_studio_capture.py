"""Capture videos against the truth written beside them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from scipy.ndimage import map_coordinates
from typer.testing import CliRunner

from relit_camera.base.errors import LightsError
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.rotations import Angles
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.light.environments.environment_store import EnvironmentStore
from relit_studio.capture.capture_scene import Scene, Timing, dimmed
from relit_studio.capture.flash.torch import Torch
from relit_studio.capture.persons.captured_person import to_rest
from relit_studio.capture.persons.field_person import FieldPerson
from relit_studio.capture.persons.head_motion import REST, HeadMotion, Motion
from relit_studio.capture.persons.mannequin_person import MannequinPerson, phone_camera
from relit_studio.capture.phone import SENSOR, Stages
from relit_studio.capture.recording import record
from relit_studio.commands.capture import capture
from relit_studio.mannequin.outputs.olat import write_olat

pytestmark = pytest.mark.slow

WIDTH, HEIGHT = 90, 120
PLAIN = Stages(gamma=False, noise=False, auto_exposure=False, white_balance=False, h264=False)


def run(*arguments: str) -> str:
    app = typer.Typer()
    app.command()(capture)
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 0, result.output
    return result.output


def read(folder: Path) -> tuple[np.ndarray, dict[str, Any]]:
    truth = json.loads((folder / "truth.json").read_text())
    with VideoReader(folder / truth["video"]) as video:
        return np.array([frame.image for frame in video]), truth


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[np.ndarray, dict[str, Any]]:
    """Three seconds, linear and exact: scene light (frames, height, width, 3), clipped at 1.18, and the truth."""
    folder = tmp_path_factory.mktemp("capture") / "plain"
    run("--out", str(folder), "--seconds", "3", "--size", f"{WIDTH}x{HEIGHT}", "--room", "overcast", "--plain")
    frames, truth = read(folder)
    assert {path.name for path in folder.iterdir()} == {"capture.mkv", "truth.json", "sheet.png"}
    return (frames / np.float32(255 * SENSOR.white)).astype(np.float32), truth


def states(truth: dict[str, Any], state: str) -> list[int]:
    return [frame["index"] for frame in truth["frames"] if frame["flash"]["state"] == state]


def lit_rows(frame: dict[str, Any]) -> np.ndarray:
    y, fraction = np.array(frame["flash"]["lit_rows_px_share"]).T
    return np.asarray(np.interp(np.arange(HEIGHT) + 0.5, y, fraction))


def test_a_frame_for_every_thirtieth_of_three_seconds(plain: tuple[np.ndarray, dict[str, Any]]) -> None:
    light, truth = plain
    assert light.shape == (90, HEIGHT, WIDTH, 3)
    assert [frame["index"] for frame in truth["frames"]] == list(range(90))
    assert truth["frames"][30]["time_s"] == pytest.approx(1)
    kinds = {state: len(states(truth, state)) for state in ("bright", "dark", "partial")}
    assert min(kinds.values()) > 15


def test_rows_are_as_bright_as_the_schedule_says(plain: tuple[np.ndarray, dict[str, Any]]) -> None:
    light, truth = plain
    person = slice(WIDTH // 3, 2 * WIDTH // 3)
    rows = light[:, 45:, person].mean(axis=(2, 3))
    bright, dark = (np.array(states(truth, state)) for state in ("bright", "dark"))
    errors = []
    for index in states(truth, "partial"):
        on, off = (rows[group[np.abs(group - index).argmin()]] for group in (bright, dark))
        steady = on > 3 * off
        measured = (rows[index] - off)[steady] / (on - off)[steady]
        errors.append(measured - lit_rows(truth["frames"][index])[45:][steady])
    # The nearest wholly lit frame is one or two frames away, and the torch has moved on.
    assert np.sqrt(np.mean(np.concatenate(errors) ** 2)) < 0.06
    assert abs(np.mean(np.concatenate(errors))) < 0.02


def test_highlight_lies_where_the_truth_has_it(plain: tuple[np.ndarray, dict[str, Any]]) -> None:
    light, truth = plain
    room = np.median(light[states(truth, "dark")], axis=0)
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    ball = truth["ball"]
    inside = np.hypot(x - ball["x_px"], y - ball["y_px"]) < ball["radius_px"]
    misses = []
    for index in states(truth, "bright"):
        if truth["frames"][index]["light"]["off_aim_deg"] > 20:
            continue
        added = np.where(inside, (light[index] - room).mean(axis=2), 0)
        added = np.where(added > 0.5 * added.max(), added, 0)
        found = np.array([(x * added).sum(), (y * added).sum()]) / added.sum()
        misses.append(found - truth["frames"][index]["highlight_px"])
    assert len(misses) > 15
    # A clipped blob of a few pixels.
    assert np.abs(np.mean(misses, axis=0)).max() < 0.05
    assert np.hypot(*np.transpose(misses)).max() < 0.35


def test_ball_is_where_the_truth_has_it(plain: tuple[np.ndarray, dict[str, Any]]) -> None:
    light, truth = plain
    # What is not the room behind is the ball, up in that corner.
    room, _ = dimmed(EnvironmentStore().load("overcast"), 0.08)
    camera = phone_camera(WIDTH, HEIGHT)
    behind = room.seen_along(camera.rays(*camera.pixel_grid()))
    dark = np.median(light[states(truth, "dark")], axis=0)
    ball = truth["ball"]
    corner = np.s_[: int(ball["y_px"] + 1.6 * ball["radius_px"]), int(ball["x_px"] - 1.6 * ball["radius_px"]) :]
    differs = np.abs(dark - behind).max(axis=2)[corner] > 2 / 255
    rows, columns = np.nonzero(differs)
    x, y = columns + 0.5 + corner[1].start, rows + 0.5
    assert (x.mean(), y.mean()) == pytest.approx((ball["x_px"], ball["y_px"]), abs=0.5)
    assert np.sqrt(len(x) / np.pi) == pytest.approx(ball["radius_px"], abs=0.6)


def test_flash_lights_the_side_it_stands_on(plain: tuple[np.ndarray, dict[str, Any]]) -> None:
    light, truth = plain
    sides = set()
    for index in states(truth, "bright"):
        azimuth = np.degrees(np.arctan2(*np.array(truth["frames"][index]["light"]["direction"])[[0, 2]]))
        face = light[index, 45:85, 30:60].mean(axis=(0, 2))
        if abs(azimuth) > 45:
            assert (face[16:].mean() > 1.3 * face[:14].mean()) == (azimuth > 0)
            sides.add(azimuth > 0)
    assert sides == {False, True}


def test_transform_to_rest_undoes_the_movement_in_the_picture() -> None:
    _, light_map = dimmed(EnvironmentStore().load("overcast"), 0.5)
    person = MannequinPerson(phone_camera(240, 320), light_map)
    motion = Motion(Angles(1.5, -1.0, 4.0), np.array([0.8, -0.5, 0.4]))
    found = to_rest(person, person.face_points(), motion)
    assert found.rotation_deg == pytest.approx(-4, abs=0.3)
    rest, moved = (person.layers(m, None).ambient for m in (REST, motion))
    # Counter-clockwise about the picture's center, y down: where each pixel at rest comes from.
    x, y = (grid - shift for grid, shift in zip(person.camera.pixel_grid(), found.translation_px, strict=True))
    x, y, turn = x - 120, y - 160, np.radians(found.rotation_deg)
    source = (np.sin(turn) * x + np.cos(turn) * y + 159.5, np.cos(turn) * x - np.sin(turn) * y + 119.5)
    aligned = np.stack([map_coordinates(moved[..., c], source, order=1) for c in range(3)], axis=-1).astype(np.float32)
    face = np.zeros((320, 240), np.float32)
    seen = person.camera.project(person.face_points())[:, :2].astype(int)
    face[seen[:, 1], seen[:, 0]] = 1
    assert psnr(aligned, rest, face) > psnr(moved, rest, face) + 8
    assert found.residual_px < 1.5


def test_head_moves_as_little_as_somebody_who_sits_still() -> None:
    motions = [HeadMotion(5).at(time) for time in np.arange(0, 30, 0.1)]
    angles = np.array([motion.angles for motion in motions])
    sway = np.array([motion.translation_cm for motion in motions])
    assert (angles.std(axis=0) < 1.2).all()
    assert np.abs(angles).max() < 3
    assert 0.05 < sway.std() < 0.4
    held = HeadMotion(5, amount=0).at(3.0)
    assert not np.any(held.angles)
    assert not held.translation_cm.any()


def test_motion_is_undone_by_its_inverse() -> None:
    motion = Motion(Angles(10, -5, 3), np.array([1.0, 2.0, -3.0]))
    points = np.random.default_rng(0).normal(size=(20, 3)) * 9
    np.testing.assert_allclose(motion.undo(motion.apply(points)), points, atol=1e-9)


@pytest.fixture(scope="module")
def brief() -> Scene:
    """A third of a second, small."""
    room, light_map = dimmed(EnvironmentStore().load("overcast"), 0.08)
    return Scene(MannequinPerson(phone_camera(66, 88), light_map), room, Timing(seconds=1 / 3), seed=2)


def test_interrupted_capture_goes_on_and_ends_the_same(brief: Scene, tmp_path: Path) -> None:
    def stop_after(count: int) -> Callable[[int, int], None]:
        def progress(done: int, total: int) -> None:
            if done == count:
                raise KeyboardInterrupt

        return progress

    whole, parts = tmp_path / "whole", tmp_path / "parts"
    stages = Stages(h264=False)
    record(brief, stages, whole, "overcast", 2)
    with pytest.raises(KeyboardInterrupt):
        record(brief, stages, parts, "overcast", 2, stop_after(4))
    assert {path.name for path in parts.iterdir()} == {".frames"}
    kept, seen = parts / ".frames" / "000001.png", []
    before = kept.stat().st_mtime_ns
    record(brief, stages, parts, "overcast", 2, lambda done, total: seen.append(kept.stat().st_mtime_ns))
    assert set(seen) == {before}
    assert {path.name for path in parts.iterdir()} == {"capture.mkv", "truth.json", "sheet.png"}
    (ours, our_truth), (theirs, their_truth) = read(whole), read(parts)
    np.testing.assert_array_equal(ours, theirs)
    assert our_truth == their_truth
    gains = np.array([[frame["exposure_gain"], *frame["white_balance_gain"]] for frame in our_truth["frames"]])
    assert np.ptp(gains[:, 0]) > 0.03
    assert (np.ptp(gains[:, [1, 3]], axis=0) > 0.001).all()
    assert (gains[:, 2] == 1).all()


def test_a_second_ball_is_filmed_and_told(brief: Scene, tmp_path: Path) -> None:
    scene = Scene(brief.person, brief.room, brief.timing, seed=2, balls=2)
    record(scene, PLAIN, tmp_path, "overcast", 2)
    frames, truth = read(tmp_path)
    second = truth["second_ball"]
    assert second["radius_cm"] == truth["ball"]["radius_cm"]
    assert second["x_px"] < brief.camera.width / 2 < truth["ball"]["x_px"]
    # Nothing but the second ball is new, and it shows the lamp where the truth says.
    index = next(frame["index"] for frame in truth["frames"] if frame["flash"]["state"] == "bright")
    alone = brief.light(brief.frame_state(index)) * SENSOR.white * 255
    new = np.abs(frames[index] - np.clip(alone, 0, 255)).max(axis=2)
    x, y = brief.camera.pixel_grid()
    away = np.hypot(x - second["x_px"], y - second["y_px"]) / second["radius_px"]
    assert new[away > 3].max() < 1
    assert np.median(new[away < 0.9]) > 2
    added = scene.parts(scene.frame_state(index))[1].sum(axis=2) * (away < 1)
    bright = added * (added > 0.5 * added.max())
    light = truth["frames"][index]
    np.testing.assert_allclose(
        [(x * bright).sum() / bright.sum(), (y * bright).sum() / bright.sum()], light["second_highlight_px"], atol=0.3
    )
    toward = np.subtract(light["light"]["position_cm"], second["centre_cm"])
    np.testing.assert_allclose(light["light"]["at_second_ball"], toward / np.linalg.norm(toward), atol=1e-5)


def test_frames_of_other_settings_are_not_taken_up(brief: Scene, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        record(brief, Stages(), tmp_path, "overcast", 2, _interrupt)
    record(brief, PLAIN, tmp_path, "overcast", 2)
    frames, _ = read(tmp_path)
    plain_light = brief.light(brief.frame_state(0)) * SENSOR.white * 255
    np.testing.assert_allclose(frames[0], np.clip(plain_light, 0, 255), atol=0.51)


def test_frames_of_another_ambient_light_are_not_taken_up(brief: Scene, tmp_path: Path) -> None:
    room, light_map = dimmed(EnvironmentStore().load("overcast"), 0.3)
    lighter = Scene(MannequinPerson(brief.camera, light_map), room, brief.timing, seed=2)
    with pytest.raises(KeyboardInterrupt):
        record(brief, PLAIN, tmp_path, "overcast", 2, _interrupt)
    record(lighter, PLAIN, tmp_path, "overcast", 2)
    frames, _ = read(tmp_path)
    plain_light = lighter.light(lighter.frame_state(0)) * SENSOR.white * 255
    np.testing.assert_allclose(frames[0], np.clip(plain_light, 0, 255), atol=0.51)


def _interrupt(done: int, total: int) -> None:
    raise KeyboardInterrupt


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mannequin's own one-light pictures, with the camera that made them."""
    folder = tmp_path_factory.mktemp("field")
    write_olat(folder, size=64, lights=120)
    camera = {"focal_px": 64 * 50 / 36.5, "depth_zero_cm": 50.0}
    (folder / "field.json").write_text(json.dumps({"camera": camera, "credits": ["Somebody, CC-BY 3.0"]}))
    return folder


def test_person_of_a_field_looks_like_the_one_rendered_anew(field: Path) -> None:
    _, light_map = dimmed(EnvironmentStore().load("window"), 0.5)
    interpolated = FieldPerson(field, 64, light_map)
    seat = np.array([0.0, 1.4, -50.0])
    rendered = MannequinPerson(interpolated.camera, light_map, seat)
    np.testing.assert_allclose(interpolated.origin, seat, atol=0.5)
    assert interpolated.credits == ("Somebody, CC-BY 3.0",)
    motion = Motion(Angles(1.5, -1.0, 1.0), np.array([0.3, 0.2, -0.3]))
    position = seat + np.array([-35.0, 25.0, 55.0])
    torch = Torch(position, (seat - position) / np.linalg.norm(seat - position))
    ours, theirs = (person.layers(motion, torch) for person in (interpolated, rendered))
    head = theirs.matte * (np.arange(64)[:, None] < 47)
    assert psnr(ours.flash, theirs.flash, head) > 24
    assert psnr(ours.ambient, theirs.ambient, head) > 24
    # Nearer than a distant light: the same direction without the correction is far off.
    far = Torch(seat + 50 * (position - seat), torch.aim)
    distant = interpolated.layers(motion, far).flash * np.float32(50**2)
    assert psnr(distant, theirs.flash, head) < psnr(ours.flash, theirs.flash, head) - 1.5


@pytest.mark.parametrize(
    ("name", "text", "problem"),
    [
        ("field.json", None, "cannot read"),
        ("field.json", '{"camera": {"focal_px": 100}}', "does not describe"),
        ("field.json", '{"camera": {"focal_px": -1, "depth_zero_cm": 50}}', "focal_px -1"),
        ("truth.npz", None, "cannot read"),
        ("truth.npz", "no array", "depth"),
        ("truth.npz", "", "depth"),
        ("truth.npz", "PK\x03\x04 cut off", "depth"),
    ],
)
def test_field_without_camera_or_depth_is_refused(
    field: Path, tmp_path: Path, name: str, text: str | None, problem: str
) -> None:
    folder = tmp_path / "damaged"
    shutil.copytree(field, folder)
    (folder / name).unlink() if text is None else (folder / name).write_text(text)
    with pytest.raises(LightsError, match=problem):
        FieldPerson(folder, 64, np.ones((32, 64, 3), np.float32))


def test_absurd_size_is_a_usage_error(tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(capture)
    result = CliRunner().invoke(app, ["--out", str(tmp_path / "x"), "--size", "10x10"])
    assert result.exit_code == 2
    assert not (tmp_path / "x").exists()
