"""`.lp` files and what they name: read right, or refused with the line that is wrong."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from relit_camera.base.errors import ImageError, LightsError
from relit_camera.base.images.image_files import read_display
from relit_camera.capture.lights_file import read_lights
from relit_camera.capture.picture_import import import_samples
from relit_camera.capture.reflectance.olat_samples import OlatSamples
from tests.synthetic import sphere_samples, write_lights


@pytest.fixture
def lights(tmp_path: Path) -> Path:
    return write_lights(tmp_path, sphere_samples(30, 16))


def test_pictures_come_back_linear(lights: Path) -> None:
    truth = sphere_samples(30, 16)
    samples = import_samples(lights)
    np.testing.assert_allclose(samples.directions, truth.directions, atol=1e-7)
    np.testing.assert_allclose(samples.pictures, truth.pictures, atol=0.006)
    np.testing.assert_array_equal(samples.matte, truth.matte)


def test_gamma_is_applied(lights: Path) -> None:
    code = read_display(lights.parent / "005.png") / 255
    np.testing.assert_allclose(import_samples(lights, "linear").pictures[5], code, atol=1e-6)
    np.testing.assert_allclose(import_samples(lights, 2.2).pictures[5], code**2.2, atol=1e-6)


def test_sixteen_bits_and_spaces_in_names(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    lines = ["5"]
    for index, direction in enumerate([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, 1), (0, -1, 0)]):
        cv2.imwrite(str(tmp_path / f"a b {index}.png"), rng.integers(0, 65535, (9, 8, 3), dtype=np.uint16))
        lines.append(f"a b {index}.png {direction[0]} {direction[1]} {direction[2]}")
    (tmp_path / "l.lp").write_text("\r\n".join(lines))
    assert import_samples(tmp_path / "l.lp", "linear").pictures.shape == (5, 9, 8, 3)


def _edit(path: Path, line: int, text: str) -> None:
    lines = path.read_text().splitlines()
    lines[line] = text
    path.write_text("\n".join(lines))


@pytest.mark.parametrize(
    ("line", "text", "message"),
    [
        (0, "31", "announces 31 lights and lists 30"),
        (0, "many", "line 1: expected the count"),
        (4, "003.png 0 0 0", "line 5: the direction of 003.png has length 0"),
        (4, "003.png 0 0 1.02", "length 1.02"),
        (4, "003.png nan 0 1", "expected 'file x y z'"),
        (4, "003.png 0 1", "expected 'file x y z'"),
        (4, "gone.png 0 0 1", "no picture at"),
    ],
)
def test_a_wrong_line_is_named(lights: Path, line: int, text: str, message: str) -> None:
    _edit(lights, line, text)
    with pytest.raises(LightsError, match=message):
        read_lights(lights)


def test_two_sizes_are_refused(lights: Path) -> None:
    cv2.imwrite(str(lights.parent / "007.png"), np.zeros((16, 17, 3), np.uint8))
    with pytest.raises(LightsError, match=r"007.png is 17x16, 000.png is 16x16"):
        import_samples(lights)


def test_a_matte_of_another_size_is_refused(lights: Path) -> None:
    cv2.imwrite(str(lights.parent / "matte.png"), np.zeros((8, 8), np.uint8))
    with pytest.raises(LightsError, match=r"matte.png is 8x8"):
        import_samples(lights)


@pytest.mark.parametrize("size", [(7, 24), (24, 7)])
def test_pictures_too_small_for_a_subject_are_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    made = sphere_samples(30, 24)
    height, width = size
    cut = OlatSamples(made.pictures[:, :height, :width], made.directions, made.matte[:height, :width])
    with pytest.raises(LightsError, match=f"000.png is {width}x{height}, a subject has 8 to 8192 pixels a side; give"):
        import_samples(write_lights(tmp_path, cut))


def test_pictures_that_are_black_where_the_matte_is_are_refused(lights: Path) -> None:
    matte = cv2.imread(str(lights.parent / "matte.png"), cv2.IMREAD_GRAYSCALE)
    assert matte is not None
    outside = 255 - matte
    cv2.imwrite(str(lights.parent / "matte.png"), outside)
    with pytest.raises(LightsError, match=r"black where matte.png is white; .* check matte.png"):
        import_samples(lights)


def test_a_damaged_picture_is_named(lights: Path) -> None:
    (lights.parent / "002.png").write_bytes(b"\x89PNG\r\n\x1a\n broken")
    with pytest.raises(ImageError, match=r"002.png cannot be read"):
        import_samples(lights)


def test_binary_and_missing_files_are_no_lp(tmp_path: Path) -> None:
    (tmp_path / "x.lp").write_bytes(bytes(range(256)))
    with pytest.raises(LightsError, match="not a text file"):
        read_lights(tmp_path / "x.lp")
    with pytest.raises(LightsError, match="cannot read"):
        read_lights(tmp_path / "none.lp")
