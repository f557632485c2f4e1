"""The converter: each operator against NumPy, on tiny networks."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import onnx
import pytest
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from relit_camera.base.errors import ModelError
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.base.models.tflite.tflite_converter import OPERATORS, convert_tflite_to_onnx
from tests.base.models.tflite_writer import NetworkWriter, Operator

Array = NDArray[np.float32]
SAME, VALID = 0, 1
RELU = 1


def noise(*shape: int, seed: int = 0) -> Array:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def run(writer: NetworkWriter, output: int, feed: Array) -> Array:
    """Convert a network whose only input is tensor 0 and run it."""
    data = convert_tflite_to_onnx(writer.write([0], [output]), "tiny", ["image"], ["result"])
    opened = open_session(data, "tiny", SessionOptions("cpu"))
    assert opened.outputs["result"].shape == writer.tensors[output][0]
    return opened.run({"image": feed})["result"]


def single(
    kind: str, feed: Array, constants: list[NDArray], shape: tuple[int, ...], *options: str | dict[str, int]
) -> Array:
    """The result of one operator on `feed` and `constants`."""
    writer = NetworkWriter()
    inputs = [writer.computed(*feed.shape), *(writer.constant(data) for data in constants)]
    output = writer.computed(*shape)
    writer.operators.append(Operator(kind, inputs, [output], options or None))  # type: ignore[arg-type]
    return run(writer, output, feed)


def windows(picture: Array, size: tuple[int, int], stride: int, padding: int, fill: float = 0) -> Array:
    """(rows, columns, channel, height, width) of what a window sees, by TFLite's definition of SAME."""
    if padding == SAME:
        total = [max((-(-n // stride) - 1) * stride + k - n, 0) for n, k in zip(picture.shape[1:3], size, strict=True)]
        around = [(0, 0), *((cells // 2, cells - cells // 2) for cells in total), (0, 0)]
        picture = np.pad(picture, around, constant_values=fill)
    return sliding_window_view(picture[0], size, (0, 1))[::stride, ::stride]


@pytest.mark.parametrize("stride", [1, 2, 3])
@pytest.mark.parametrize("padding", [SAME, VALID])
@pytest.mark.parametrize("size", [(1, 1), (3, 3), (2, 5)])
def test_convolution(stride: int, padding: int, size: tuple[int, int]) -> None:
    picture, weights, bias = noise(1, 9, 8, 3), noise(4, *size, 3, seed=1), noise(4, seed=2)
    expected = np.einsum("yxchw,ohwc->yxo", windows(picture, size, stride, padding), weights) + bias
    values = {"StrideH": stride, "StrideW": stride, "Padding": padding, "FusedActivationFunction": RELU}
    shape = (1, *expected.shape)
    result = single("CONV_2D", picture, [weights, bias], shape, "Conv2DOptions", values)
    np.testing.assert_allclose(result[0], np.maximum(expected, 0), atol=1e-5)


@pytest.mark.parametrize("stride", [1, 2])
def test_depthwise_convolution(stride: int) -> None:
    picture, weights, bias = noise(1, 8, 7, 3), noise(1, 3, 3, 6, seed=1), noise(6, seed=2)
    seen = np.repeat(windows(picture, (3, 3), stride, SAME), 2, axis=2)  # two outputs of each input channel
    expected = np.einsum("yxchw,hwc->yxc", seen, weights[0]) + bias
    values = {"StrideH": stride, "StrideW": stride, "Padding": SAME, "DepthMultiplier": 2}
    shape = (1, *expected.shape)
    result = single("DEPTHWISE_CONV_2D", picture, [weights, bias], shape, "DepthwiseConv2DOptions", values)
    np.testing.assert_allclose(result[0], expected, atol=1e-5)


def test_dilated_convolution() -> None:
    picture, weights = noise(1, 8, 8, 2), noise(3, 3, 3, 2, seed=1)
    spread = np.zeros((3, 5, 5, 2), np.float32)
    spread[:, ::2, ::2] = weights
    expected = np.einsum("yxchw,ohwc->yxo", windows(picture, (5, 5), 1, SAME), spread)
    values = {"StrideH": 1, "StrideW": 1, "Padding": SAME, "DilationHFactor": 2, "DilationWFactor": 2}
    result = single("CONV_2D", picture, [weights, np.zeros(3, np.float32)], (1, 8, 8, 3), "Conv2DOptions", values)
    np.testing.assert_allclose(result[0], expected, atol=1e-5)


def test_transposed_convolution_paints_a_patch_for_each_cell() -> None:
    picture, weights, bias = noise(1, 3, 4, 5), noise(1, 2, 2, 5, seed=1), np.array([0.25], np.float32)
    patches = np.einsum("yxc,hwc->yhxw", picture[0], weights[0]).reshape(6, 8) + bias
    result = single("Convolution2DTransposeBias", picture, [weights, bias], (1, 6, 8, 1))
    np.testing.assert_allclose(result[0, ..., 0], patches, atol=1e-5)


@pytest.mark.parametrize(("kind", "fill"), [("MAX_POOL_2D", -np.inf), ("AVERAGE_POOL_2D", np.nan)])
def test_pooling_does_not_count_the_border(kind: str, fill: float) -> None:
    picture = noise(1, 7, 5, 3) - 5  # negative, so that zeros from outside would win
    seen = windows(picture, (3, 3), 2, SAME, fill)
    expected = seen.max((3, 4)) if kind == "MAX_POOL_2D" else np.nanmean(seen, (3, 4))
    values = {"FilterHeight": 3, "FilterWidth": 3, "StrideH": 2, "StrideW": 2, "Padding": SAME}
    result = single(kind, picture, [], (1, *expected.shape), "Pool2DOptions", values)
    np.testing.assert_allclose(result[0], expected, atol=1e-5)


def test_pooling_of_the_whole_picture() -> None:
    picture = noise(1, 6, 5, 3)
    values = {"FilterHeight": 6, "FilterWidth": 5, "StrideH": 6, "StrideW": 5, "Padding": VALID}
    result = single("AVERAGE_POOL_2D", picture, [], (1, 1, 1, 3), "Pool2DOptions", values)
    np.testing.assert_allclose(result, picture.mean((1, 2), keepdims=True), atol=1e-6)


UNARY: dict[str, Callable[[Array], Array]] = {
    "HARD_SWISH": lambda x: x * np.clip(x + 3, 0, 6) / np.float32(6),
    "LOGISTIC": lambda x: np.reciprocal(1 + np.exp(-x)),
    "NEG": np.negative,
    "RELU": lambda x: np.maximum(x, 0),
}
POSITIVE: dict[str, Callable[[Array], Array]] = {"RSQRT": lambda x: np.reciprocal(np.sqrt(x)), "SQRT": np.sqrt}


@pytest.mark.parametrize("kind", [*UNARY, *POSITIVE])
def test_functions_of_one_input(kind: str) -> None:
    feed: Array = noise(2, 7) * 4 if kind in UNARY else np.abs(noise(2, 7)) + np.float32(0.1)
    np.testing.assert_allclose(single(kind, feed, [], (2, 7)), {**UNARY, **POSITIVE}[kind](feed), rtol=1e-5, atol=1e-6)


BINARY: dict[str, tuple[str | None, Callable[[Array, Array], Array]]] = {
    "ADD": ("AddOptions", np.add),
    "SUB": ("SubOptions", np.subtract),
    "MUL": ("MulOptions", np.multiply),
    "DIV": ("DivOptions", np.divide),
    "SQUARED_DIFFERENCE": (None, lambda a, b: (a - b) ** 2),
}


@pytest.mark.parametrize("kind", BINARY)
@pytest.mark.parametrize("shape", [(), (4,), (3, 1), (1, 2, 3, 4)])
def test_functions_of_two_inputs_broadcast(kind: str, shape: tuple[int, ...]) -> None:
    options, function = BINARY[kind]
    feed, other = noise(1, 2, 3, 4), np.asarray(noise(*shape, seed=1) + 3, np.float32)
    result = single(kind, feed, [other], (1, 2, 3, 4), *((options, {}) if options else ()))
    np.testing.assert_allclose(result, function(feed, other), rtol=1e-5, atol=1e-6)


def test_prelu_with_slopes_above_one() -> None:
    feed, slopes = noise(1, 3, 3, 4) * 10, np.array([[[19.8, 1.0, -0.5, 0.2]]], np.float32)
    expected = np.where(feed > 0, feed, slopes * feed)
    np.testing.assert_allclose(single("PRELU", feed, [slopes], feed.shape), expected, rtol=1e-5, atol=1e-4)


def bottleneck(channels: int) -> tuple[bytes, Array, Array]:
    """A network of 1×1 convolution, PReLU, depthwise and 1×1 convolution; a picture; and the true result."""
    writer, picture, slopes = NetworkWriter(), noise(1, 5, 4, 6), noise(1, 1, channels, seed=1) * 5
    into, into_bias = noise(channels, 1, 1, 6, seed=2), noise(channels, seed=3)
    each, each_bias = noise(1, 3, 3, channels, seed=4), noise(channels, seed=5)
    out, out_bias = noise(7, 1, 1, channels, seed=6), noise(7, seed=7)
    inner = [writer.computed(*picture.shape), *(writer.computed(1, 5, 4, channels) for _ in range(3))]
    result = writer.computed(1, 5, 4, 7)
    convolution = {"StrideH": 1, "StrideW": 1, "Padding": SAME}
    depthwise = {**convolution, "DepthMultiplier": 1}

    def constants(*arrays: Array) -> list[int]:
        return [writer.constant(array) for array in arrays]

    writer.operators = [
        Operator("CONV_2D", [inner[0], *constants(into, into_bias)], [inner[1]], ("Conv2DOptions", convolution)),
        Operator("PRELU", [inner[1], *constants(slopes)], [inner[2]]),
        Operator(
            "DEPTHWISE_CONV_2D",
            [inner[2], *constants(each, each_bias)],
            [inner[3]],
            ("DepthwiseConv2DOptions", depthwise),
        ),
        Operator("CONV_2D", [inner[3], *constants(out, out_bias)], [result], ("Conv2DOptions", convolution)),
    ]
    truth = np.einsum("byxc,oc->byxo", picture, into[:, 0, 0]) + into_bias
    truth = np.where(truth > 0, truth, slopes * truth)
    truth = np.einsum("yxchw,hwc->yxc", windows(truth, (3, 3), 1, SAME), each[0])[None] + each_bias
    truth = np.einsum("byxc,oc->byxo", truth, out[:, 0, 0]) + out_bias
    return convert_tflite_to_onnx(writer.write([0], [result]), "tiny", ["image"], ["result"]), picture, truth


@pytest.mark.parametrize(("channels", "products"), [(4, 0), (8, 0), (9, 2)])
def test_prelu_between_convolutions_of_few_channels_becomes_part_of_them(channels: int, products: int) -> None:
    data, picture, truth = bottleneck(channels)
    kinds = [node.op_type for node in onnx.load_from_string(data).graph.node]
    assert kinds.count("Mul") == products
    assert "PRelu" not in kinds
    result = open_session(data, "tiny", SessionOptions("cpu")).run({"image": picture})["result"]
    np.testing.assert_allclose(result, truth, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("kind", ["MEAN", "SUM"])
@pytest.mark.parametrize("axes", [-1, [1, 2], [2]])
@pytest.mark.parametrize("keep", [True, False])
def test_reductions(kind: str, axes: int | list[int], keep: bool) -> None:
    feed, axis = noise(1, 3, 4, 5), tuple(np.atleast_1d(axes))
    expected = (feed.mean if kind == "MEAN" else feed.sum)(axis=axis, keepdims=keep)
    result = single(kind, feed, [np.array(axes, np.int32)], expected.shape, "ReducerOptions", {"KeepDims": keep})
    np.testing.assert_allclose(result, expected, atol=1e-5)


SLICES: dict[str, tuple[list[int], list[int], list[int], dict[str, int], tuple]] = {
    "inside": ([0, 1, 2], [2, 3, 5], [1, 1, 2], {}, np.s_[0:2, 1:3, 2:5:2]),
    "negative": ([0, -2, 0], [2, -1, 9], [1, 1, 1], {}, np.s_[0:2, -2:-1, 0:9]),
    "masked": ([1, 1, 1], [1, 1, 1], [1, 1, 1], {"BeginMask": 0b101, "EndMask": 0b111}, np.s_[:, 1:, :]),
    "dropped": ([1, -1, 0], [2, 0, 9], [1, 1, 1], {"ShrinkAxisMask": 0b011}, np.s_[1, -1, 0:9]),
}


@pytest.mark.parametrize("case", SLICES)
def test_slices(case: str) -> None:
    begin, end, strides, masks, expected = SLICES[case]
    feed = noise(2, 4, 5)
    bounds = [np.array(values, np.int32) for values in (begin, end, strides)]
    result = single("STRIDED_SLICE", feed, bounds, feed[expected].shape, "StridedSliceOptions", masks)
    np.testing.assert_array_equal(result, feed[expected])


@pytest.mark.parametrize("size", [(8, 12), (7, 5)])
def test_bilinear_resizing_takes_pixel_centres_at_halves(size: tuple[int, int]) -> None:
    feed = noise(1, 4, 6, 2)
    values = {"HalfPixelCenters": 1}
    shape = (1, *size, 2)
    result = single("RESIZE_BILINEAR", feed, [np.array(size, np.int32)], shape, "ResizeBilinearOptions", values)
    np.testing.assert_allclose(result[0], cv2.resize(feed[0], size[::-1], interpolation=cv2.INTER_LINEAR), atol=1e-5)


def after_a_convolution(operator: Operator, shape: tuple[int, ...], constants: list[NDArray]) -> tuple[Array, Array]:
    """What `operator` makes of a picture whose channels are first at that point, and the picture itself.

    The operator's inputs and outputs are filled in: the picture and the constants, and a tensor of `shape`.
    """
    writer, feed, weights = NetworkWriter(), noise(1, 4, 6, 3), noise(5, 1, 1, 3, seed=1)
    writer.computed(*feed.shape)
    half = writer.constant(weights.astype(np.float16))
    whole, bias, picture = writer.computed(*weights.shape), writer.constant(noise(5)), writer.computed(1, 4, 6, 5)
    writer.operators.append(Operator("DEQUANTIZE", [half], [whole]))
    values = {"StrideH": 1, "StrideW": 1, "Padding": VALID}
    writer.operators.append(Operator("CONV_2D", [0, whole, bias], [picture], ("Conv2DOptions", values)))
    operator.inputs = [picture, *(writer.constant(data) for data in constants)]
    operator.outputs = [writer.computed(*shape)]
    writer.operators.append(operator)
    truth = np.einsum("byxc,oc->byxo", feed, weights[:, 0, 0].astype(np.float16).astype(np.float32)) + noise(5)
    return run(writer, operator.outputs[0], feed), truth


ARRANGEMENTS: dict[str, tuple[Operator, list[NDArray], Callable[[Array], Array]]] = {
    "reshape": (Operator("RESHAPE", [], []), [], lambda x: x.reshape(1, 24, 5)),
    "transpose": (
        Operator("TRANSPOSE", [], []),
        [np.array([0, 2, 3, 1], np.int32)],
        lambda x: x.transpose(0, 2, 3, 1),
    ),
    "pad": (
        Operator("PAD", [], []),
        [np.array([[0, 0], [1, 0], [0, 2], [3, 4]], np.int32)],
        lambda x: np.pad(x, [(0, 0), (1, 0), (0, 2), (3, 4)]),
    ),
    "pad of channels": (
        Operator("PAD", [], []),
        [np.array([[0, 0], [0, 0], [0, 0], [3, 4]], np.int32)],
        lambda x: np.pad(x, [(0, 0), (0, 0), (0, 0), (3, 4)]),
    ),
    "concatenation": (
        Operator("CONCATENATION", [], [], ("ConcatenationOptions", {"Axis": -1})),
        [noise(1, 4, 6, 2)],
        lambda x: np.concatenate([x, noise(1, 4, 6, 2)], -1),
    ),
    "mean": (
        Operator("MEAN", [], [], ("ReducerOptions", {"KeepDims": 1})),
        [np.array([1, 2], np.int32)],
        lambda x: x.mean((1, 2), keepdims=True),
    ),
    "mean of channels": (
        Operator("MEAN", [], [], ("ReducerOptions", {"KeepDims": 1})),
        [np.array([-1], np.int32)],
        lambda x: x.mean(-1, keepdims=True),
    ),
    "mean away": (
        Operator("MEAN", [], [], ("ReducerOptions", {"KeepDims": 0})),
        [np.array([1], np.int32)],
        lambda x: x.mean(1),
    ),
    "channel weights": (
        Operator("MUL", [], [], ("MulOptions", {})),
        [noise(5, seed=3)],
        lambda x: x * noise(5, seed=3),
    ),
    "row weights": (
        Operator("MUL", [], [], ("MulOptions", {})),
        [noise(4, 1, 1, seed=3)],
        lambda x: x * noise(4, 1, 1, seed=3),
    ),
    "prelu": (Operator("PRELU", [], []), [noise(1, 1, 5)], lambda x: np.where(x > 0, x, x * noise(1, 1, 5))),
}


@pytest.mark.parametrize("case", ARRANGEMENTS)
def test_layouts_do_not_mix(case: str) -> None:
    operator, constants, expected = ARRANGEMENTS[case]
    shape = expected(np.zeros((1, 4, 6, 5), np.float32)).shape
    result, picture = after_a_convolution(operator, shape, constants)
    np.testing.assert_allclose(result, expected(picture), rtol=1e-4, atol=1e-4)


def test_a_picture_with_channels_first_meets_a_computed_vector() -> None:
    writer, feed, weights = NetworkWriter(), noise(1, 4, 6, 3), noise(5, 1, 1, 3, seed=1)
    convolution = [writer.computed(*feed.shape), writer.constant(weights), writer.constant(noise(5))]
    picture, mean, result = writer.computed(1, 4, 6, 5), writer.computed(5), writer.computed(1, 4, 6, 5)
    values = {"StrideH": 1, "StrideW": 1, "Padding": VALID}
    axes = writer.constant(np.array([0, 1, 2], np.int32))
    writer.operators = [
        Operator("CONV_2D", convolution, [picture], ("Conv2DOptions", values)),
        Operator("MEAN", [picture, axes], [mean], ("ReducerOptions", {"KeepDims": 0})),
        Operator("SUB", [picture, mean], [result], ("SubOptions", {})),
    ]
    truth = np.einsum("byxc,oc->byxo", feed, weights[:, 0, 0]) + noise(5)
    np.testing.assert_allclose(run(writer, result, feed), truth - truth.mean((0, 1, 2)), atol=1e-5)


def test_the_same_bytes_give_the_same_bytes() -> None:
    writer = NetworkWriter()
    writer.computed(2, 3)
    writer.operators.append(Operator("RELU", [0], [writer.computed(2, 3)]))
    assert convert_tflite_to_onnx(writer.write([0], [1]), "tiny", ["a"], ["b"]) == convert_tflite_to_onnx(
        writer.write([0], [1]), "tiny", ["a"], ["b"]
    )


def one_operator(kind: str, *options: str | dict[str, int]) -> bytes:
    writer = NetworkWriter()
    writer.computed(1, 4, 4, 2)
    writer.operators.append(Operator(kind, [0, 0], [writer.computed(1, 4, 4, 2)], options or None))  # type: ignore[arg-type]
    return writer.write([0], [1])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no TFLite network"),
        (b"PK\x03\x04 not a network", "no TFLite network"),
        (one_operator("ADD", "AddOptions", {})[:200], "no TFLite network"),
        (one_operator("COS"), "tiny cannot be converted: it has the operator COS"),
        (one_operator("SomethingOfTheirs"), "it has the operator SomethingOfTheirs"),
        (one_operator("ADD", "AddOptions", {"FusedActivationFunction": 4}), "the fused activation 4 of ADD"),
        (one_operator("CONV_2D", "Conv2DOptions", {}), "computed where only a constant"),
    ],
)
def test_what_cannot_be_converted_is_one_clear_line(data: bytes, message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        convert_tflite_to_onnx(data, "tiny", ["image"], ["result"])
    assert "\n" not in str(caught.value)


def test_other_inputs_outputs_and_graphs_are_refused() -> None:
    with pytest.raises(ModelError, match="1 inputs and 1 outputs, not 2 and 1"):
        convert_tflite_to_onnx(one_operator("ADD", "AddOptions", {}), "tiny", ["a", "b"], ["result"])
    writer = NetworkWriter()
    writer.computed(1)
    with pytest.raises(ModelError, match="has 2 graphs"):
        convert_tflite_to_onnx(writer.write([0], [0], graphs=2), "tiny", ["a"], ["b"])


def test_integer_weights_are_refused() -> None:
    writer = NetworkWriter()
    writer.computed(2)
    weights = writer.constant(np.arange(2, dtype=np.int8))
    writer.operators.append(Operator("DEQUANTIZE", [weights], [writer.computed(2)]))
    with pytest.raises(ModelError, match="it has int8 weights"):
        convert_tflite_to_onnx(writer.write([0], [2]), "tiny", ["a"], ["b"])


def test_every_operator_of_the_table_is_tested() -> None:
    tested = {*UNARY, *POSITIVE, *BINARY, *(operator.kind for operator, _, _ in ARRANGEMENTS.values())}
    tested |= {"CONV_2D", "DEPTHWISE_CONV_2D", "Convolution2DTransposeBias", "DEQUANTIZE", "MAX_POOL_2D"}
    tested |= {"AVERAGE_POOL_2D", "MEAN", "SUM", "STRIDED_SLICE", "RESIZE_BILINEAR"}
    tested |= {"Landmarks2TransformMatrix", "TransformTensorBilinear", "TransformLandmarks"}  # test_region_operators.py
    assert tested == set(OPERATORS)
