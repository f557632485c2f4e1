"""`relit relight` gives the captured light back, and light comes from where a person sees it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.config.look import EnvironmentBackground
from relit_camera.base.images.image_files import read_display, read_linear, read_mask, write_display, write_linear
from relit_camera.base.images.image_quality import psnr
from relit_camera.base.images.image_types import Mask
from relit_camera.base.rotations import rotation_from_angles
from relit_camera.base.video.video_readers import VideoReader
from relit_camera.capture.lights_file import read_lights
from relit_camera.capture.reflectance.method_registry import open_method
from relit_camera.light.directions import texel_directions, texel_solid_angles
from relit_camera.light.environments.environment_panorama import read_panorama
from relit_camera.live.compositing.environment_view import EnvironmentView
from tests.cli.relit_command import Answer, Material, call
from tests.replay.materials import subject_file
from tests.synthetic import render_sphere, sphere_samples, sphere_surface, write_lights

pytestmark = pytest.mark.slow

SETS = {"yaleB02/lights_clean.lp": "linear", "adam/lights.lp": "srgb"}
PICKED = 4


def done(answer: Answer) -> None:
    assert answer.code == 0, answer.err


def degrees(direction: NDArray[np.float64]) -> str:
    x, y, z = direction
    return f"{np.degrees(np.arctan2(x, z)):.6f},{np.degrees(np.arcsin(y)):.6f}"


def matte_of(lights: Path) -> Mask | None:
    """The matte beside an .lp file, if there is one."""
    path = lights.parent / "matte.png"
    return read_mask(path) if path.is_file() else None


def white_panorama(folder: Path) -> Path:
    path = folder / "white.exr"
    write_linear(path, np.ones((64, 128, 3), np.float32))
    return path


@pytest.fixture(scope="session")
def sphere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A subject: a white Lambertian sphere with a shadowing bump, 32 pixels wide."""
    folder = tmp_path_factory.mktemp("sphere")
    lights = write_lights(folder / "capture", sphere_samples())
    done(call("capture", "import", lights, "--out", folder / "sphere.relit", "--method", "barycentric"))
    return folder / "sphere.relit"


@pytest.mark.parametrize("name", SETS)
def test_captured_direction_returns_the_captured_frame(name: str, shared: Path, tmp_path: Path) -> None:
    lights, gamma = shared / "olat" / name, SETS[name]
    subject = subject_file(lights, gamma)
    listed = read_lights(lights)
    out, reached = tmp_path / "one.npy", {}
    for light in listed[:: max(1, len(listed) // PICKED)][:PICKED]:
        # `=` since a negative azimuth would look like an option
        done(call("relight", subject, f"--light={degrees(light.direction)}", "--linear", "--out", out))
        reached[light.path.name] = psnr(np.load(out), read_linear(light.path, gamma), matte_of(lights))
    print(name, {key: round(value, 1) for key, value in reached.items()})
    assert len(reached) == PICKED
    assert min(reached.values()) >= 40, reached


@pytest.mark.parametrize("name", SETS)
def test_white_environment_gives_the_sum_picture(name: str, shared: Path, tmp_path: Path) -> None:
    """The captured frames, each counting by the solid angle that it stands for."""
    lights, gamma = shared / "olat" / name, SETS[name]
    listed = read_lights(lights)
    out = tmp_path / "white.npy"
    white = white_panorama(tmp_path)
    done(call("relight", subject_file(lights, gamma), "--environment", white, "--linear", "--out", out))
    directions = np.array([light.direction for light in listed])
    weights = open_method("barycentric").weights(directions, texel_directions().reshape(-1, 3))  # type: ignore[attr-defined]
    truth = sum(
        fraction * read_linear(light.path, gamma)
        for light, fraction in zip(listed, weights @ texel_solid_angles().ravel(), strict=True)
    )
    quality = psnr(np.load(out), np.asarray(truth, np.float32), matte_of(lights))
    print(f"{name}: {quality:.1f} dB from the sum")
    assert quality >= 40


def test_generated_sphere_under_a_captured_and_a_white_light(sphere: Path, tmp_path: Path) -> None:
    samples = sphere_samples()
    out = tmp_path / "one.npy"
    for index in (10, 100, 200):
        done(call("relight", sphere, f"--light={degrees(samples.directions[index])}", "--linear", "--out", out))
        assert psnr(np.load(out), render_sphere(samples.directions[index], 32), samples.matte) > 40
    done(call("relight", sphere, "--environment", white_panorama(tmp_path), "--linear", "--out", out))
    weights = texel_solid_angles().ravel()
    truth = sum(w * render_sphere(d, 32) for w, d in zip(weights, texel_directions().reshape(-1, 3), strict=True))
    assert psnr(np.load(out), np.asarray(truth, np.float32), samples.matte) > 35


def window_at_the_viewers_left(folder: Path, suffix: str) -> Path:
    """A panorama file, dim but for a bright window behind the subject, on the side that the viewer sees at the left.

    Looking along −Z the file's left and right edges meet in the view's middle; its left half is the right part of the
    view. So the window lies just inside of the file's right edge.
    """
    path = folder / f"window{suffix}"
    picture = np.full((128, 256, 3), 0.02, np.float32)
    picture[44:84, 236:250] = 1.0 if suffix == ".png" else 30.0
    if suffix == ".png":
        write_display(path, np.round(picture * 255).astype(np.uint8))
    else:
        write_linear(path, picture)
    return path


def brightness(picture: NDArray, columns: slice) -> float:
    return float(picture[:, columns].mean())


@pytest.mark.parametrize("suffix", [".exr", ".png"])
def test_window_seen_at_the_left_lights_the_left_rim(suffix: str, sphere: Path, tmp_path: Path) -> None:
    panorama = window_at_the_viewers_left(tmp_path, suffix)
    view = EnvironmentView(read_panorama(panorama), (160, 90), EnvironmentBackground().height_deg, 0.0)
    seen = view.picture(rotation_from_angles(0, 0, 0), 1.0)
    assert brightness(seen, slice(0, 60)) > brightness(seen, slice(100, 160)) + 60

    done(call("relight", sphere, "--environment", panorama, "--linear", "--out", tmp_path / "rim.npy"))
    lit = np.load(tmp_path / "rim.npy").mean(axis=2)
    width = lit.shape[1]
    assert brightness(lit, slice(0, width // 4)) > 1.5 * brightness(lit, slice(3 * width // 4, width))


def test_replay_shows_the_window_at_the_left_behind_the_person(material: Material, tmp_path: Path) -> None:
    panorama = window_at_the_viewers_left(tmp_path, ".exr")
    out = tmp_path / "out.mp4"
    done(
        call(
            "replay", material.clip, "--subject", material.subject, "--environment", panorama,
            "--background", "environment", "--mode", "portrait", "--tracker", material.tracker, "--out", out,
        )
    )  # fmt: skip
    with VideoReader(out) as video:
        picture = next(iter(video)).image
    edge = picture.shape[1] // 10
    assert brightness(picture, slice(0, edge)) > brightness(picture, slice(-edge, None)) + 20


def test_directions_rounded_to_whole_degrees_at_the_edge_of_a_capture(shared: Path, tmp_path: Path) -> None:
    lights = shared / "olat" / "yaleB02" / "lights_clean.lp"
    out = tmp_path / "edge.npy"
    done(call("relight", subject_file(lights, "linear"), "--light=-50,-40", "--linear", "--out", out))
    frame = read_linear(lights.parent / "yaleB02_P00A+050E-40.png", "linear")
    assert psnr(np.load(out), frame) >= 40


@pytest.mark.parametrize(("light", "side"), [("90,0", 1), ("-90,0", -1)])
def test_azimuth_ninety_is_the_pictures_right(light: str, side: int, sphere: Path, tmp_path: Path) -> None:
    out = tmp_path / "side.png"
    done(call("relight", sphere, f"--light={light}", "--out", out))
    picture = read_display(out)
    half = picture.shape[1] // 2
    assert side * (brightness(picture, slice(half, None)) - brightness(picture, slice(0, half))) > 20


@pytest.mark.parametrize("pose", [(30, 0, 0), (0, 25, 0), (0, 0, 40), (20, -15, 10)])
def test_a_turned_head_under_one_light(pose: tuple[float, float, float], sphere: Path, tmp_path: Path) -> None:
    """One light fixed in the room: the turned head sees it from R⁻¹ · l."""
    light = np.array([np.sin(0.6), 0.3, np.cos(0.6)])
    light /= np.linalg.norm(light)
    out = tmp_path / "turned.npy"
    text = ",".join(map(str, pose))
    done(call("relight", sphere, f"--light={degrees(light)}", f"--rotate={text}", "--linear", "--out", out))
    truth = render_sphere(rotation_from_angles(*pose).inv().apply(light), 32)
    matte = sphere_surface(32)[1].astype(np.float32)
    assert psnr(np.load(out), truth, matte) > 22
    assert psnr(np.load(out), render_sphere(light, 32), matte) < psnr(np.load(out), truth, matte) - 4


def test_result_formats(sphere: Path, tmp_path: Path) -> None:
    linear = {}
    for suffix in (".npy", ".exr"):
        done(call("relight", sphere, "--environment", "studio", "--linear", "--out", tmp_path / f"x{suffix}"))
        linear[suffix] = np.load(tmp_path / "x.npy") if suffix == ".npy" else read_linear(tmp_path / "x.exr")
    np.testing.assert_allclose(linear[".npy"], linear[".exr"], rtol=1e-6)
    done(call("relight", sphere, "--environment", "studio", "--out", tmp_path / "x.png"))
    shown = cv2.imread(str(tmp_path / "x.png"))
    assert shown is not None
    assert shown.shape == (32, 32, 3)
    assert shown.max() > 100
    answer = call("relight", sphere, "--environment", "studio", "--out", tmp_path / "y.npy")
    assert answer.code == 2
    assert "--linear" in answer.err
    assert call("relight", sphere, "--out", tmp_path / "y.png").code == 2
