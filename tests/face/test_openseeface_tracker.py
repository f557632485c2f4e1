from __future__ import annotations

import numpy as np
import pytest

from relit_camera.face.detection.face_detector import Detection
from relit_camera.face.landmarks.rotated_crop import bounding_box
from relit_camera.face.tracking.openseeface_tracker import OpenSeeFaceNetwork, decode_heat_maps
from tests.face.faces import face


def sigmoid(value: float) -> float:
    return 1 / (1 + np.exp(-value))


class FakeSession:
    """Answers with given maps and keeps what it was fed."""

    def __init__(self, maps: np.ndarray) -> None:
        self.maps = maps
        self.fed: np.ndarray | None = None

    def run(self, feeds: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        self.fed = feeds["input"]
        return {"output": self.maps[None]}


def network(maps: np.ndarray) -> tuple[OpenSeeFaceNetwork, FakeSession]:
    session = FakeSession(maps)
    net = OpenSeeFaceNetwork(session)  # type: ignore[arg-type]
    return net, session


def maps_of(row: int, column: int, down: float, right: float, peak: float = 0.9) -> np.ndarray:
    """Heat maps with one peak at a cell, and offsets in shares of the input."""
    maps = np.full((198, 28, 28), 0.05, np.float32)
    maps[:66, row, column] = peak
    maps[66:132, row, column] = sigmoid(16 * down)
    maps[132:, row, column] = sigmoid(16 * right)
    return maps


def test_decoding_follows_the_formula() -> None:
    points, peaks = decode_heat_maps(maps_of(row=9, column=18, down=-0.02, right=0.03))
    np.testing.assert_allclose(points[:, 0], 223 * (18 / 27 + 0.03) + 0.5, atol=1e-3)
    np.testing.assert_allclose(points[:, 1], 223 * (9 / 27 - 0.02) + 0.5, atol=1e-3)
    np.testing.assert_allclose(peaks, 0.9)
    assert points.shape == (66, 2)
    assert points.dtype == np.float32


def test_each_point_has_its_own_maps() -> None:
    maps = maps_of(5, 5, 0, 0)
    maps[7, 20, 10] = 1.0
    maps[66 + 7, 20, 10] = maps[132 + 7, 20, 10] = 0.5
    points, _ = decode_heat_maps(maps)
    np.testing.assert_allclose(points[7], [223 * 10 / 27 + 0.5, 223 * 20 / 27 + 0.5], atol=1e-3)
    np.testing.assert_allclose(points[8], 223 * 5 / 27 + 0.5, atol=1e-3)


def test_saturated_offsets_stay_finite() -> None:
    maps = maps_of(5, 5, 0, 0)
    maps[66:] = np.where(np.arange(132)[:, None, None] % 2, 0.0, 1.0)
    assert np.isfinite(decode_heat_maps(maps)[0]).all()


def test_reading_normalises_and_maps_back() -> None:
    net, session = network(maps_of(row=0, column=27, down=0, right=0, peak=0.7))
    crop = net.crop_from_detection(Detection((100, 50, 100, 80), np.zeros((2, 2), np.float32), 0.9))
    reading = net.read(np.full((200, 300, 3), [255, 128, 0], np.uint8), crop)
    assert session.fed is not None
    assert session.fed.shape == (1, 3, 224, 224)
    assert session.fed.dtype == np.float32
    expected = (np.array([1, 128 / 255, 0]) - [0.485, 0.456, 0.406]) / [0.229, 0.224, 0.225]
    np.testing.assert_allclose(session.fed[0, :, 100, 100], expected, atol=1e-5)
    # The margins are 10 % and 12.5 % a side: the crop spans x 90..210 and y 40..140.
    np.testing.assert_allclose(reading.points[0], [90 + 120 * 223.5 / 224, 40 + 100 * 0.5 / 224], atol=0.01)
    assert reading.confidence == pytest.approx(0.7)
    assert net.blendshapes(reading.points) == {}


def test_the_crop_from_points_is_upright() -> None:
    net, _ = network(maps_of(0, 0, 0, 0))
    points = face(roll=30).landmarks
    crop = net.crop_from_points(points)
    x, y, width, height = bounding_box(points)
    assert crop.angle == 0
    assert crop.width == pytest.approx(1.2 * width)
    assert crop.height == pytest.approx(1.25 * height)
    np.testing.assert_allclose(crop.center, (x + width / 2, y + height / 2))
