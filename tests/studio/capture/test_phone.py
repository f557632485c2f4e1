"""The phone's processing, stage by stage."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relit_camera.base.errors import StorageError
from relit_camera.base.images.color import linear_from_uint8
from relit_camera.base.video.video_readers import VideoReader
from relit_studio.cameras.camera_simulation import Gains
from relit_studio.capture.lossless_writer import LosslessWriter
from relit_studio.capture.phone import SENSOR, Phone, Stages

OFF = Stages(gamma=False, noise=False, auto_exposure=False, white_balance=False, h264=False)
MEAN = np.array([0.2, 0.2, 0.2], np.float32)


def scene(scale: float = 1.0, tint: tuple[float, float, float] = (1, 1, 1)) -> np.ndarray:
    ramp = np.linspace(0, 1, 64 * 48, dtype=np.float32).reshape(48, 64, 1)
    return ramp * np.array(tint, np.float32) * np.float32(scale)


def test_with_all_stages_off_the_code_is_the_light() -> None:
    coded = Phone(OFF, 1, MEAN).develop(scene(), Gains(), 0)
    assert np.abs(coded / 255 / SENSOR.white - scene()).max() <= 0.5 / 255 / SENSOR.white + 1e-6


def test_gamma_alone_is_undone_by_the_srgb_curve() -> None:
    coded = Phone(replace(OFF, gamma=True), 1, MEAN).develop(scene(), Gains(), 0)
    wrong = np.abs(linear_from_uint8(coded) / SENSOR.white - scene())
    # Half a code of a curve that is at most 2.3 times as steep as the line.
    assert wrong.max() <= 0.5 / 255 * 2.3 / SENSOR.white + 1e-4


def test_gains_alone_are_undone_by_division() -> None:
    gains = Gains(exposure_ev=-0.4, balance=(0.1, -0.2))
    coded = Phone(OFF, 1, MEAN).develop(scene(), gains, 0)
    back = coded / 255 / SENSOR.white / gains.exposure / np.array(gains.white_balance)
    assert np.abs(back - scene()).max() <= 0.5 / 255 / SENSOR.white / gains.exposure / min(gains.white_balance) + 1e-6


def test_noise_grows_with_light_and_is_the_same_again() -> None:
    phone = Phone(replace(OFF, noise=True), 1, MEAN)
    dark, bright = (np.full((64, 64, 3), value, np.float32) for value in (0.05, 0.6))
    spreads = [phone.develop(light, Gains(), 0).astype(float).std() / 255 for light in (dark, bright)]
    expected = [np.sqrt(SENSOR.shot * value * SENSOR.white + SENSOR.read**2 + 1 / 12 / 255**2) for value in (0.05, 0.6)]
    assert spreads == pytest.approx(expected, rel=0.05)
    np.testing.assert_array_equal(phone.develop(bright, Gains(), 0), phone.develop(bright, Gains(), 0))
    assert (phone.develop(bright, Gains(), 0) != phone.develop(bright, Gains(), 1)).any()


def test_automatics_that_are_off_stay_put() -> None:
    assert Phone(OFF, 1, MEAN).settle(Gains(), scene(3, (1, 0.5, 0.2))) == Gains()


def test_exposure_overshoots_then_settles() -> None:
    phone = Phone(replace(OFF, auto_exposure=True), 1, MEAN)
    gains, course = Gains(), []
    for _ in range(60):
        gains = phone.settle(gains, scene(0.55))
        course.append(gains.exposure_ev)
    wanted = np.log2(0.2 / scene(0.55).mean())
    assert abs(course[0]) < 0.3 * abs(wanted)
    assert min(course) < wanted - 0.02 < wanted < 0
    assert course[-1] == pytest.approx(wanted, abs=0.01)


def test_white_balance_pulls_a_tinted_picture_to_gray_within_its_limits() -> None:
    phone = Phone(replace(OFF, white_balance=True), 1, MEAN)
    gains = Gains()
    for _ in range(200):
        gains = phone.settle(gains, scene(0.4, (1.1, 1, 0.9)))
    red, green, blue = gains.white_balance
    assert (red, green, blue) == pytest.approx((1 / 1.1, 1, 1 / 0.9), abs=0.01)
    for _ in range(200):
        gains = phone.settle(gains, scene(0.4, (3, 1, 0.1)))
    assert gains.white_balance == pytest.approx((np.exp(-0.25), 1, np.exp(0.25)))


def test_lossless_video_keeps_every_code(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    pictures = [rng.integers(0, 256, (50, 66, 3), dtype=np.uint8) for _ in range(4)]
    with LosslessWriter(tmp_path / "a.mkv", (66, 50), 30) as writer:
        for picture in pictures:
            writer.write(picture)
    with VideoReader(tmp_path / "a.mkv") as video:
        read = [frame.image for frame in video]
    np.testing.assert_array_equal(read, pictures)


def test_a_failed_lossless_video_leaves_nothing(tmp_path: Path) -> None:
    def fail() -> None:
        with LosslessWriter(tmp_path / "a.mkv", (66, 50), 30) as writer:
            writer.write(np.zeros((50, 66, 3), np.uint8))
            raise KeyError("stop")

    with pytest.raises(KeyError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_lossless_video_whose_end_cannot_be_written_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fill_disk(writer: LosslessWriter, frame: object) -> None:
        raise StorageError("the disk is full")

    writer = LosslessWriter(tmp_path / "a.mkv", (66, 50), 30)
    writer.write(np.zeros((50, 66, 3), np.uint8))
    monkeypatch.setattr(LosslessWriter, "_mux", fill_disk)
    with pytest.raises(StorageError), writer:
        pass
    assert list(tmp_path.iterdir()) == []
