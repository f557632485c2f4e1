from collections.abc import Sequence
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from relit_camera.base.errors import VideoError
from relit_camera.base.images.color import Gamma, linear_from_uint8, srgb_decode
from relit_camera.base.video.video_readers import LinearVideoFrame, LinearVideoReader, LumaVideoReader, VideoReader
from relit_camera.base.video.video_writer import VideoWriter


def lossless(path: Path, planes: Sequence[NDArray[np.uint16]], pixel_format: str) -> Path:
    """One FFV1 frame of 10-bit planes (h, w), as they are."""
    height, width = planes[0].shape
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=30)
        stream.width, stream.height, stream.pix_fmt = width, height, pixel_format
        stream.codec_context.colorspace, stream.codec_context.color_range = 1, 1
        picture = av.VideoFrame(width, height, pixel_format)
        picture.colorspace, picture.color_range = 1, 1
        for plane, values in zip(picture.planes, planes, strict=True):
            rows = np.zeros((height, plane.line_size // 2), np.uint16)
            rows[:, :width] = values
            plane.update(rows.tobytes())
        container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def only_frame(path: Path, *, gamma: Gamma = "srgb", longer_side: int | None = None) -> LinearVideoFrame:
    with LinearVideoReader(path, gamma, longer_side=longer_side) as video:
        (frame,) = video
    return frame


def test_ten_bits_of_rgb_arrive_whole(tmp_path: Path) -> None:
    codes = np.arange(1024, dtype=np.uint16).reshape(16, 64)
    path = lossless(tmp_path / "deep.mkv", [codes, codes[::-1], codes.T.reshape(16, 64)], "gbrp10le")
    image = only_frame(path, gamma="linear").image
    green, blue, red = codes, codes[::-1], codes.T.reshape(16, 64)
    assert image.dtype == np.float32
    assert np.abs(image * 1023 - np.stack([red, green, blue], axis=2)).max() < 0.05


def test_ten_bits_of_luma_arrive_whole(tmp_path: Path) -> None:
    luma = np.clip(np.arange(1024).reshape(16, 64), 64, 940).astype(np.uint16)
    grey = np.full_like(luma, 512)
    path = lossless(tmp_path / "deep.mkv", [luma, grey, grey], "yuv444p10le")
    image = only_frame(path, gamma="linear").image
    assert np.abs(image * 876 - (luma[..., None] - 64.0)).max() < 0.1


def test_light_is_that_of_the_frames_that_people_see(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    rng = np.random.default_rng(2)
    times = [0.0, 0.04, 0.11, 0.2]
    with VideoWriter(path, (64, 48), 30) as video:
        for time_s in times:
            video.write(cv2.resize(rng.integers(0, 256, (6, 8, 3), dtype=np.uint8), (64, 48)), time_s)
    with VideoReader(path) as seen, LinearVideoReader(path) as measured:
        pairs = list(zip(seen, measured, strict=True))
    assert [frame.time_s for _, frame in pairs] == pytest.approx(times, abs=1e-3)
    for frame, linear in pairs:
        assert linear.index == frame.index
        np.testing.assert_allclose(linear.image, linear_from_uint8(frame.image), atol=1e-6)


def test_a_small_picture_holds_the_means_of_the_large_one(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    steps = np.kron(np.arange(0, 240, 20, dtype=np.uint8).reshape(3, 4), np.ones((64, 64), np.uint8))
    with VideoWriter(path, (256, 192), 30, crf=4) as video:
        video.write(np.repeat(steps[..., None], 3, axis=2))
    frame = only_frame(path, longer_side=16)
    assert frame.image.shape == (12, 16, 3)
    expected = srgb_decode(np.arange(0, 240, 20).reshape(3, 4) / 255)
    assert np.abs(frame.image[1::4, 1::4] - expected[..., None]).max() < 0.01
    assert only_frame(path, longer_side=999).image.shape == (192, 256, 3)  # never up


def test_a_turned_video_is_small_and_upright(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    image = np.zeros((64, 128, 3), np.uint8)
    image[:, :64] = 250
    with VideoWriter(path, (128, 64), 30, crf=4) as video:
        video.write(image)
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + 44  # the display matrix, 16.16: a quarter turn clockwise
    data[at : at + 36] = np.array([0, 1 << 16, 0, -1 << 16, 0, 0, 0, 0, 1 << 30], ">i4").tobytes()
    path.write_bytes(data)
    with LinearVideoReader(path, longer_side=32) as video:
        small = next(iter(video)).image
        assert (video.info.width, video.info.height) == (64, 128)
    assert small.shape == (32, 16, 3)
    assert small[:14].min() > 0.8
    assert small[18:].max() < 0.05


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    with pytest.raises(VideoError, match="no video"):
        LinearVideoReader(tmp_path / "nowhere.mp4")


def test_frames_that_nobody_wants_are_not_made(tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    with VideoWriter(path, (64, 48), 25, crf=4) as video:
        for index in range(9):
            video.write(np.full((48, 64, 3), 20 * index, np.uint8))
    with LinearVideoReader(path, "linear", only={3, 7}) as video:
        frames = list(video)
    assert [frame.index for frame in frames] == [3, 7]
    assert [frame.time_s for frame in frames] == pytest.approx([0.12, 0.28], abs=1e-3)
    assert frames[1].image.mean() == pytest.approx(140 / 255, abs=0.01)


@pytest.mark.parametrize("bits", [8, 10])
def test_luma_alone(tmp_path: Path, bits: int) -> None:
    path = tmp_path / "clip.mkv"
    if bits == 10:
        luma = np.clip(np.arange(1024).reshape(16, 64), 64, 940).astype(np.uint16)
        lossless(path, [luma, np.full_like(luma, 512), np.full_like(luma, 512)], "yuv444p10le")
        expected = (luma - 64.0) / 876
    else:
        grey = np.kron(np.arange(0, 256, 16, dtype=np.uint8).reshape(4, 4), np.ones((16, 16), np.uint8))
        with VideoWriter(path, (64, 64), 30, crf=0) as video:
            video.write(np.repeat(grey[..., None], 3, axis=2))
        expected = grey / 255
    with LumaVideoReader(path) as video:
        (frame,) = video
    assert frame.image.dtype == np.float32
    assert np.abs(frame.image - expected).max() < (0.005 if bits == 10 else 0.012)
