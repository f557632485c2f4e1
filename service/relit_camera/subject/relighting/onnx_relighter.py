"""Relighting as an ONNX graph whose initializers hold the subject.

On a GPU provider they stay in GPU memory and only the light map and the picture travel: the thesis's finding in 6.2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.images.image_types import LinearImage
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.light.light_map import LightMap
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.relighting.basis_relighter import group_by_rank
from relit_camera.subject.relighting.relighter import dense_matrix, weighted_light
from relit_camera.subject.subject import Subject

if TYPE_CHECKING:
    from onnx import NodeProto

OPSET = 17
IR_VERSION = 9


def dense_graph(matrix: NDArray[np.float32]) -> bytes:
    """A serialised ONNX model: a matrix (3, pixels, 2048) times `light` (3, 2048, 1) → `picture` (3, pixels, 1)."""
    from onnx import helper

    node = helper.make_node("MatMul", ["matrix", "light"], ["picture"], name="multiply")
    return _serialised([node], {"matrix": matrix}, matrix.shape[1])


def basis_graph(subject: Subject) -> bytes:
    """A serialised ONNX model: `light` (3, 2048, 1) → `picture` (3, pixels, 1), the products of `BasisRelighter`."""
    from onnx import helper

    groups = group_by_rank(subject.basis)
    mixes = np.concatenate([group.mixes.reshape(-1, subject.basis.components) for group in groups])
    constants: dict[str, NDArray] = {"coefficients": subject.coefficients, "mixes": mixes}
    nodes = [
        helper.make_node("MatMul", ["coefficients", "light"], ["shared"]),
        helper.make_node("MatMul", ["mixes", "shared"], ["local"]),
        helper.make_node("Split", ["local", "ranks"], [f"local_{i}" for i in range(len(groups))], axis=1),
    ]
    for i, group in enumerate(groups):
        clusters, _, rank, _ = group.values.shape
        constants[f"values_{i}"] = group.values.transpose(1, 0, 2, 3)
        constants[f"shape_{i}"] = np.array([3, clusters, 1, rank], np.int64)
        nodes += [
            helper.make_node("Reshape", [f"local_{i}", f"shape_{i}"], [f"amounts_{i}"]),
            helper.make_node("MatMul", [f"amounts_{i}", f"values_{i}"], [f"mixed_{i}"]),
            helper.make_node("Reshape", [f"mixed_{i}", "as_column"], [f"column_{i}"]),
        ]
    places = np.concatenate([group.pixels.ravel() for group in groups])
    # Pixels of no cluster take what stands behind all places.
    place_of_pixel = np.full(subject.matte.size, len(places), np.int64)
    place_of_pixel[places] = np.arange(len(places))
    constants |= {
        "ranks": np.array([group.values.shape[0] * group.values.shape[2] for group in groups], np.int64),
        "as_column": np.array([3, -1, 1], np.int64),
        "nothing": np.zeros((3, 1, 1), np.float32),
        "place_of_pixel": place_of_pixel,
    }
    columns = [f"column_{i}" for i in range(len(groups))]
    nodes += [
        helper.make_node("Concat", [*columns, "nothing"], ["places"], axis=1),
        helper.make_node("Gather", ["places", "place_of_pixel"], ["picture"], axis=1),
    ]
    return _serialised(nodes, constants, subject.matte.size)


def _serialised(nodes: list[NodeProto], constants: dict[str, NDArray], pixels: int) -> bytes:
    from onnx import TensorProto, helper, numpy_helper

    graph = helper.make_graph(
        nodes,
        "relight",
        [helper.make_tensor_value_info("light", TensorProto.FLOAT, [3, TEXELS, 1])],
        [helper.make_tensor_value_info("picture", TensorProto.FLOAT, [3, pixels, 1])],
        [numpy_helper.from_array(np.ascontiguousarray(value), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    serialised: bytes = model.SerializeToString()
    return serialised


class _OnnxRelighter:
    def __init__(self, subject: Subject, name: str, graph: bytes, options: SessionOptions | None) -> None:
        self.session = open_session(graph, name, options or SessionOptions())
        self._shape = (subject.metadata.height, subject.metadata.width)

    def relight(self, light_map: LightMap) -> LinearImage:
        """See `Relighter.relight`."""
        light = np.ascontiguousarray(weighted_light(light_map).T)[..., None]
        picture = self.session.run({"light": light})["picture"]
        return np.ascontiguousarray(picture[..., 0].T).reshape(*self._shape, 3)


class OnnxBasisRelighter(_OnnxRelighter):
    """The bases as a graph: in each group of clusters of equal rank one product.

    Raises:
        DeviceError: a strict provider is not to be had.
    """

    def __init__(self, subject: Subject, options: SessionOptions | None = None) -> None:
        super().__init__(subject, "relight-basis", basis_graph(subject), options)


class OnnxDenseRelighter(_OnnxRelighter):
    """The dense matrix as a graph of one product; too large for a graph of one file over 2 GB.

    Raises:
        DeviceError: a strict provider is not to be had.
    """

    def __init__(self, subject: Subject, options: SessionOptions | None = None) -> None:
        super().__init__(subject, "relight-dense", dense_graph(dense_matrix(subject)), options)
