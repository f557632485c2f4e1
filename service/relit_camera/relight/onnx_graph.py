"""Relighting as an ONNX graph whose initializers hold the subject.

On a GPU provider they stay in GPU memory and only the light map and the picture travel: the thesis's finding in 6.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relit_camera.light.maps import LightMap
from relit_camera.models.session import SessionOptions, open_session
from relit_camera.relight.dense import dense_matrix
from relit_camera.relight.relighter import masked_basis, weighted_light
from relit_camera.space.images import LinearImage
from relit_camera.subject.subject import Subject

OPSET = 17
IR_VERSION = 9


def product_graph(factors: dict[str, NDArray[np.float32]], rows: int) -> bytes:
    """A serialised ONNX model: `light` (3, rows, 1) multiplied from the left by each factor in turn → `picture`.

    Args:
        factors: name → (3, n, m) or (n, m) float32, in the order in which they are applied.
        rows: rows of the light vector.
    """
    from onnx import TensorProto, helper, numpy_helper

    nodes, current = [], "light"
    for name in factors:
        result = "picture" if name == list(factors)[-1] else f"after_{name}"
        nodes.append(helper.make_node("MatMul", [name, current], [result], name=f"multiply_{name}"))
        current = result
    pixels = list(factors.values())[-1].shape[-2]
    graph = helper.make_graph(
        nodes,
        "relight",
        [helper.make_tensor_value_info("light", TensorProto.FLOAT, [3, rows, 1])],
        [helper.make_tensor_value_info("picture", TensorProto.FLOAT, [3, pixels, 1])],
        [numpy_helper.from_array(np.ascontiguousarray(value), name) for name, value in factors.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    serialised: bytes = model.SerializeToString()
    return serialised


class _OnnxRelighter:
    def __init__(self, subject: Subject, name: str, factors: dict[str, NDArray[np.float32]], options: SessionOptions):
        rows = next(iter(factors.values())).shape[-1]
        self.session = open_session(product_graph(factors, rows), name, options)
        self._shape = (subject.metadata.height, subject.metadata.width)

    def relight(self, light_map: LightMap) -> LinearImage:
        """See `Relighter.relight`."""
        light = np.ascontiguousarray(weighted_light(light_map).T)[..., None]
        picture = self.session.run({"light": light})["picture"]
        return np.ascontiguousarray(picture[..., 0].T).reshape(*self._shape, 3)


class OnnxBasisRelighter(_OnnxRelighter):
    """The basis as a graph of two products.

    Raises:
        DeviceError: a strict provider is not to be had.
    """

    def __init__(self, subject: Subject, options: SessionOptions | None = None) -> None:
        factors = {"coefficients": subject.coefficients, "basis": masked_basis(subject).transpose(0, 2, 1)}
        super().__init__(subject, "relight-basis", factors, options or SessionOptions())


class OnnxDenseRelighter(_OnnxRelighter):
    """The dense matrix as a graph of one product; too large for a graph of one file over 2 GB.

    Raises:
        DeviceError: a strict provider is not to be had.
    """

    def __init__(self, subject: Subject, options: SessionOptions | None = None) -> None:
        super().__init__(subject, "relight-dense", {"matrix": dense_matrix(subject)}, options or SessionOptions())
