"""The operators of networks with attention, against MediaPipe's definition of them in NumPy."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from flatbuffers import flexbuffers
from numpy.typing import NDArray

from relit_camera.base.errors import ModelError
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.base.models.tflite.tflite_converter import convert_tflite_to_onnx
from tests.base.models.tflite_writer import NetworkWriter, Operator

CHOSEN = [0, 3, 4, 7, 8]
"""An odd number: MediaPipe reads them in pairs, and the last one twice."""
OPTIONS = {
    "left_rotation_idx": 1,
    "right_rotation_idx": 2,
    "target_rotation_radians": 0.25,
    "output_height": 6,
    "output_width": 5,
    "scale_x": 1.5,
    "scale_y": 1.25,
    "subset_idxs": CHOSEN,
}


def points_in(side: float, seed: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).uniform(0.3 * side, 0.7 * side, (1, 9, 3)).astype(np.float32)


def expected_matrix(points: NDArray[np.float32]) -> NDArray[np.float64]:
    """Step by step, as the kernel multiplies its matrices: shift, turn, scale, shift."""
    (left_x, left_y), (right_x, right_y) = points[0, 1, :2], points[0, 2, :2]
    turn = OPTIONS["target_rotation_radians"] - math.atan2(right_y - left_y, right_x - left_x)  # type: ignore[operator]

    def turned(angle: float) -> NDArray[np.float64]:
        return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])

    upright = points[0, CHOSEN, :2] @ turned(turn).T
    low, high = upright.min(axis=0), upright.max(axis=0)
    scale = (high - low) * [1.5 / 5, 1.25 / 6]
    matrix = np.eye(4)
    matrix[:2, :2] = turned(-turn) @ np.diag(scale)
    matrix[:2, 3] = turned(-turn) @ ((low + high) / 2) - matrix[:2, :2] @ [2.5, 3]
    return matrix


def operator(kind: str, inputs: list[int], output: int, options: Mapping[str, object] | None = None) -> Operator:
    return Operator(kind, inputs, [output], custom_options=bytes(flexbuffers.Dumps(options)) if options else b"")


def run(writer: NetworkWriter, output: int, *feeds: NDArray[np.float32]) -> NDArray[np.float32]:
    names = [f"input{index}" for index in range(len(feeds))]
    data = convert_tflite_to_onnx(writer.write(range(len(feeds)), [output]), "tiny", names, ["result"])
    opened = open_session(data, "tiny", SessionOptions("cpu"))
    return opened.run(dict(zip(names, feeds, strict=True)))["result"]


@pytest.mark.parametrize("seed", range(4))
def test_the_region_is_the_turned_box_of_its_landmarks(seed: int) -> None:
    writer = NetworkWriter()
    source, target = writer.computed(1, 9, 3), writer.computed(1, 4, 4)
    writer.operators.append(operator("Landmarks2TransformMatrix", [source], target, OPTIONS))
    points = points_in(40, seed)
    np.testing.assert_allclose(run(writer, target, points)[0], expected_matrix(points), atol=1e-4)


def test_landmarks_of_the_region_lie_in_the_picture() -> None:
    writer = NetworkWriter()
    source, matrix, target = writer.computed(1, 7, 2), writer.computed(1, 4, 4), writer.computed(1, 7, 2)
    writer.operators.append(operator("TransformLandmarks", [source, matrix], target))
    points = np.random.default_rng(0).uniform(0, 5, (1, 7, 2)).astype(np.float32)
    taken = expected_matrix(points_in(40, 1)).astype(np.float32)
    expected = points[0] @ taken[:2, :2].T + taken[:2, 3]
    np.testing.assert_allclose(run(writer, target, points, taken[None])[0], expected, atol=1e-4)


@pytest.mark.parametrize("side", [24.0, 30.0])
def test_the_region_is_sampled_and_is_zero_outside_the_picture(side: float) -> None:
    """The box lies partly outside the picture of 20 x 16."""
    picture = np.random.default_rng(0).normal(size=(1, 16, 20, 3)).astype(np.float32)
    matrix = expected_matrix(points_in(side, 2)).astype(np.float32)
    expected, outside = np.zeros((6, 5, 3)), 0
    for row in range(6):
        for column in range(5):
            x, y = matrix[:2, :2] @ [column + 0.5, row + 0.5] + matrix[:2, 3] - 0.5
            if not (0 <= x <= 19 and 0 <= y <= 15):
                outside += 1
                continue
            left, top = min(int(x), 18), min(int(y), 14)
            across, down = x - left, y - top
            near = picture[0, top : top + 2, left : left + 2]
            upper, lower = near[:, 0] * (1 - across) + near[:, 1] * across
            expected[row, column] = upper * (1 - down) + lower * down
    assert 0 < outside < 30
    writer = NetworkWriter()
    source, taken, target = writer.computed(*picture.shape), writer.computed(1, 4, 4), writer.computed(1, 6, 5, 3)
    size = {"output_height": 6, "output_width": 5}
    writer.operators.append(operator("TransformTensorBilinear", [source, taken], target, size))
    np.testing.assert_allclose(run(writer, target, picture, matrix[None])[0], expected, atol=1e-4)


def test_an_operator_without_its_options_is_refused() -> None:
    writer = NetworkWriter()
    source, target = writer.computed(1, 9, 3), writer.computed(1, 4, 4)
    writer.operators.append(operator("Landmarks2TransformMatrix", [source], target))
    with pytest.raises(ModelError, match="Landmarks2TransformMatrix has no options"):
        convert_tflite_to_onnx(writer.write([source], [target]), "tiny", ["a"], ["b"])


def test_landmarks_with_depth_are_refused() -> None:
    writer = NetworkWriter()
    source, matrix, target = writer.computed(1, 7, 3), writer.computed(1, 4, 4), writer.computed(1, 7, 3)
    writer.operators.append(operator("TransformLandmarks", [source, matrix], target))
    with pytest.raises(ModelError, match="landmarks of 3 dimensions"):
        convert_tflite_to_onnx(writer.write([source, matrix], [target]), "tiny", ["a", "b"], ["c"])
