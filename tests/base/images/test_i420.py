import av
import numpy as np
import pytest

from relit_camera.base.images.color import rgb_to_i420
from relit_camera.devices.sources.pattern_source import draw_pattern


@pytest.mark.parametrize("size", [(320, 180), (642, 482), (64, 66)])
def test_it_is_what_ffmpegs_scaler_makes(size: tuple[int, int]) -> None:
    image = np.random.default_rng(3).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    if size == (320, 180):
        image = draw_pattern(size, 99)
    frame = av.VideoFrame.from_ndarray(image, format="rgb24")
    expected = frame.reformat(format="yuv420p", dst_colorspace="ITU601", interpolation="AREA").to_ndarray().reshape(-1)
    planes = rgb_to_i420(image)
    assert planes.shape == expected.shape
    assert planes.dtype == np.uint8
    difference = np.abs(planes.astype(int) - expected)
    assert difference[: size[0] * size[1]].max() <= 1
    assert np.percentile(difference, 99) <= 2


def test_black_and_white_are_those_of_the_limited_range() -> None:
    for level, luma in ((0, 16), (255, 235)):
        planes = rgb_to_i420(np.full((64, 64, 3), level, np.uint8))
        assert set(planes[: 64 * 64]) == {luma}
        assert set(planes[64 * 64 :]) == {128}
