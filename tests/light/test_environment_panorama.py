"""Panorama files: every format, both axes, and everything that is wrong with them."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from relit_camera.base.errors import PanoramaError
from relit_camera.base.images.color import srgb_decode
from relit_camera.light.directions import texel_solid_angles
from relit_camera.light.environments import environment_panorama as panorama_module
from relit_camera.light.environments.environment_panorama import panorama_from_radiance, read_panorama
from relit_camera.light.light_map import irradiance, resample_to_light_map, total

SHARED_MAPS = [
    "dikhololo_night_1k", "lebombo_1k", "potsdamer_platz_1k", "rooitou_park_1k", "spot1Lux", "studio_small_03_1k",
    "venice_sunset_1k",
]  # fmt: skip


def picture(height: int = 16, width: int = 32) -> np.ndarray:
    return np.random.default_rng(1).random((height, width, 3)).astype(np.float32)


def write_exr(path: Path, channels: dict[str, np.ndarray]) -> Path:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {name: np.ascontiguousarray(plane) for name, plane in channels.items()}) as file:
        file.write(str(path))
    return path


def write_hdr(path: Path, image: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), image[..., ::-1].astype(np.float32))
    return path


def write_coded(path: Path, image: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), image[..., ::-1])
    return path


def test_hdr(tmp_path: Path) -> None:
    image = picture() * 50
    read = read_panorama(write_hdr(tmp_path / "a.hdr", image), axes="map")
    assert read.radiance.dtype == np.float32
    assert read.radiance.shape == (16, 32, 3)
    # RGBE shares one exponent: 8 bits of the largest channel.
    assert (np.abs(read.radiance - image).max(axis=2) <= image.max(axis=2) / 120).all()
    assert read.clipped_fraction == 0
    assert read.notes == ()


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
@pytest.mark.parametrize(
    "names", [("R", "G", "B"), ("light.R", "light.G", "light.B"), ("red", "green", "blue"), ("R", "G", "B", "A")]
)
def test_exr_of_any_layer_and_precision(tmp_path: Path, dtype: type, names: tuple[str, ...]) -> None:
    image: NDArray[np.floating] = (picture() * 9).astype(dtype)
    planes = [*np.moveaxis(image, -1, 0), np.ones((16, 32), dtype)]
    path = write_exr(tmp_path / "a.exr", dict(zip(names, planes, strict=False)))
    np.testing.assert_array_equal(read_panorama(path, axes="map").radiance, image.astype(np.float32))


def test_exr_with_luminance_only(tmp_path: Path) -> None:
    grey = picture()[..., 0]
    read = read_panorama(write_exr(tmp_path / "a.exr", {"Y": grey}), axes="map").radiance
    np.testing.assert_array_equal(read, np.repeat(grey[..., None], 3, axis=2))


@pytest.mark.parametrize(("dtype", "top"), [(np.uint8, 255), (np.uint16, 65535)])
def test_png_is_linearised(tmp_path: Path, dtype: type, top: int) -> None:
    coded: NDArray[np.unsignedinteger] = (picture() * 0.9 * top).astype(dtype)
    read = read_panorama(write_coded(tmp_path / "a.png", coded), axes="map")
    np.testing.assert_allclose(read.radiance, srgb_decode(coded / top), atol=1e-6)
    assert read.clipped_fraction == 0


def test_jpeg_with_its_clipped_highlights_said(tmp_path: Path) -> None:
    coded = np.full((64, 128, 3), 60, np.uint8)
    coded[:32, 64:] = 255
    read = read_panorama(write_coded(tmp_path / "a.JPG", coded), axes="map")
    assert read.clipped_fraction == pytest.approx(0.25, abs=0.01)
    (note,) = read.notes
    assert "25 % of the sphere is clipped" in note
    assert read.radiance[40, 30, 0] == pytest.approx(srgb_decode(60 / 255), rel=0.05)


def test_to_the_right_of_the_file_s_middle_lies_minus_x(tmp_path: Path) -> None:
    """A picture from inside the sphere: the file's left half lights +X, the picture's right."""
    bright_left = np.full((32, 64, 3), 0.1, np.float32)
    bright_left[:, 12:20] = 5
    path = write_hdr(tmp_path / "a.hdr", bright_left)
    conventions: tuple[tuple[Literal["picture", "map"], int], ...] = (("picture", 1), ("map", -1))
    for axes, side in conventions:
        light_map = resample_to_light_map(read_panorama(path, axes=axes).radiance)
        lit, dark = (irradiance(light_map, (sign * side, 0, 0))[0] for sign in (1, -1))
        assert lit > 3 * dark


def test_the_file_s_middle_is_toward_the_camera(tmp_path: Path) -> None:
    image = np.full((32, 64, 3), 0.1, np.float32)
    image[14:18, 30:34] = 50
    light_map = resample_to_light_map(read_panorama(write_hdr(tmp_path / "a.hdr", image)).radiance)
    assert irradiance(light_map, (0, 0, 1))[0] > 5 * irradiance(light_map, (0, 0, -1))[0]


@pytest.mark.parametrize(("height", "width"), [(16, 33), (16, 31), (17, 32), (15, 32), (16, 34)])
def test_a_pixel_off_two_to_one_is_resampled_with_its_energy(tmp_path: Path, height: int, width: int) -> None:
    image = picture(height, width)
    read = read_panorama(write_exr(tmp_path / "a.exr", {"RGB": image}), axes="map").radiance
    assert read.shape[1] == 2 * read.shape[0]
    expected = np.einsum("ijc,ij->c", image, texel_solid_angles(height, width))
    np.testing.assert_allclose(np.einsum("ijc,ij->c", read, texel_solid_angles(*read.shape[:2])), expected, rtol=1e-4)


def test_rounding_below_zero_is_cut_and_more_is_refused(tmp_path: Path) -> None:
    image = picture() * 100
    image[3, 4, 1] = -5e-5
    assert read_panorama(write_exr(tmp_path / "a.exr", {"RGB": image}), axes="map").radiance[3, 4, 1] == 0
    image[3, 4, 1] = -0.01
    with pytest.raises(PanoramaError, match=r"negative light, -0.01 at row 3, column 4"):
        read_panorama(write_exr(tmp_path / "b.exr", {"RGB": image}))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e30])
def test_values_that_are_no_light_are_refused(tmp_path: Path, value: float) -> None:
    image = picture()
    image[2, 7, 2] = value
    with pytest.raises(PanoramaError, match="holds NaN") as caught:
        read_panorama(write_exr(tmp_path / "a.exr", {"RGB": image}))
    assert "a.exr" in caught.value.what
    assert caught.value.cure


def test_black_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PanoramaError, match="all black"):
        read_panorama(write_coded(tmp_path / "a.png", np.zeros((16, 32, 3), np.uint8)))


@pytest.mark.parametrize("name", ["a.hdr", "a.exr", "a.png", "a.jpg"])
def test_not_two_to_one_is_refused_with_its_size(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name == "a.exr":
        write_exr(path, {"RGB": picture(16, 40)})
    elif name == "a.hdr":
        write_hdr(path, picture(16, 40))
    else:
        write_coded(path, (picture(16, 40) * 255).astype(np.uint8))
    with pytest.raises(PanoramaError, match=r"40x16 pixels, not twice as wide as high; use a 360"):
        read_panorama(path)


@pytest.mark.parametrize("kept", [0.0, 0.02, 0.5, 0.97])
@pytest.mark.parametrize("name", ["a.hdr", "a.exr", "a.png", "a.jpg"])
def test_truncated_files_are_refused_in_one_clear_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, kept: float
) -> None:
    path = tmp_path / name
    image = picture(64, 128)
    if name == "a.exr":
        write_exr(path, {"RGB": image})
    elif name == "a.hdr":
        write_hdr(path, image)
    else:
        write_coded(path, (image * 255).astype(np.uint8))
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(PanoramaError) as caught:
        read_panorama(path)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.cure
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")


@pytest.mark.parametrize("name", ["a.hdr", "a.exr", "a.png", "a.jpg"])
def test_noise_under_any_suffix_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str) -> None:
    (tmp_path / name).write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(PanoramaError, match="cannot be read"):
        read_panorama(tmp_path / name)
    assert capfd.readouterr().err == ""


def test_a_file_under_a_wrong_suffix_is_not_taken_for_another_curve(tmp_path: Path) -> None:
    write_coded(tmp_path / "a.png", (picture() * 255).astype(np.uint8))
    with pytest.raises(PanoramaError, match="not a Radiance file"):
        read_panorama((tmp_path / "a.png").rename(tmp_path / "a.hdr"))


def _huge_hdr(path: Path) -> None:
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 30000 +X 60000\n" + bytes(100))


def _huge_png(path: Path) -> None:
    path.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + struct.pack(">II", 60000, 30000) + bytes(100))


def _huge_jpeg(path: Path) -> None:
    frame = b"\xff\xc0\x00\x11\x08" + struct.pack(">HH", 30000, 60000) + bytes(100)
    path.write_bytes(b"\xff\xd8\xff\xe0\x00\x10JFIF" + bytes(10) + frame)


@pytest.mark.parametrize(("name", "write"), [("a.hdr", _huge_hdr), ("a.png", _huge_png), ("a.jpg", _huge_jpeg)])
def test_absurd_sizes_are_refused_before_memory_is_taken(
    tmp_path: Path, name: str, write: Callable[[Path], None]
) -> None:
    write(tmp_path / name)
    with pytest.raises(PanoramaError, match=r"60000x30000 pixels, more than 33\.6 million"):
        read_panorama(tmp_path / name)


def test_the_limit_is_one_of_pixels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_exr(tmp_path / "a.exr", {"RGB": picture()})
    monkeypatch.setattr(panorama_module, "MAX_PANORAMA_PIXELS", 16 * 32 - 1)
    with pytest.raises(PanoramaError, match="32x16 pixels, more than"):
        read_panorama(path)


def test_missing_files_folders_and_foreign_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(PanoramaError, match=r"no panorama at .*a\.hdr"):
        read_panorama(tmp_path / "a.hdr")
    with pytest.raises(PanoramaError, match="no panorama at"):
        read_panorama(tmp_path)
    (tmp_path / "a.gif").write_bytes(b"GIF89a")
    with pytest.raises(PanoramaError, match=r"'\.gif' is no panorama format"):
        read_panorama(tmp_path / "a.gif")


def test_radiance_from_elsewhere_is_checked_alike() -> None:
    image = picture()
    np.testing.assert_array_equal(panorama_from_radiance(image).radiance, image)
    with pytest.raises(PanoramaError, match="sky is 40x16"):
        panorama_from_radiance(picture(16, 40), "sky")
    with pytest.raises(PanoramaError, match="all black"):
        panorama_from_radiance(np.zeros((16, 32, 3), np.float32))


@pytest.mark.parametrize("name", SHARED_MAPS)
def test_real_maps_keep_their_energy(shared: Path, name: str) -> None:
    path = shared / "light" / f"{name}.hdr"
    read = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR)
    assert read is not None
    raw = read[..., ::-1].astype(np.float64)
    expected = np.einsum("ijc,ij->c", raw, texel_solid_angles(*raw.shape[:2]))
    np.testing.assert_allclose(total(resample_to_light_map(read_panorama(path).radiance)), expected, rtol=1e-3)


def test_the_calibration_spot_sums_to_its_published_value(shared: Path) -> None:
    read = read_panorama(shared / "light" / "spot1Lux.hdr")
    assert (read.radiance > 0).any(axis=2).sum() == 1
    np.testing.assert_allclose(total(read.radiance), 0.959, atol=5e-4)
    # Its README: column 597 of 1024, right of the middle, so toward −X, and above the horizon.
    _, column = np.argwhere(read.radiance[..., 1] > 0)[0]
    assert column == 1023 - 597
    light_map = resample_to_light_map(read.radiance)
    np.testing.assert_allclose(total(light_map), 0.959, atol=5e-4)
    assert irradiance(light_map, (-1, 0, 0))[0] > 0.3
    assert irradiance(light_map, (1, 0, 0))[0] == 0
