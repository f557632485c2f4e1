"""Relighting in the subject's bases with ONNX Runtime: the graph's initializers hold the subject.

On a GPU they stay in its memory, and only the light map and the picture are copied: what counts, by the thesis's 6.2.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models.session_with_fallback import open_session
from relit_camera.subject.reflectance_field import TEXELS
from relit_camera.subject.relighting.basis_relighter import groups_by_rank, mixes_by_rank
from relit_camera.subject.relighting.relighter import RelighterOptions, weighted_light
from relit_camera.subject.subject import Subject

if TYPE_CHECKING:
    from onnx import NodeProto

OPSET = 17
IR_VERSION = 9


def basis_graph(subject: Subject) -> bytes:
    """A serialised model, as `BasisRelighter` multiplies: `light` (3, 2048, count) → `pictures` (3, pixels, count)."""
    from onnx import helper

    groups = groups_by_rank(subject.basis)
    mixes = np.concatenate(list(mixes_by_rank(subject.basis, groups)))
    constants: dict[str, NDArray] = {"coefficients": subject.coefficients, "mixes": mixes}
    nodes = [
        helper.make_node("MatMul", ["coefficients", "light"], ["shared"]),
        helper.make_node("MatMul", ["mixes", "shared"], ["local"]),
        helper.make_node("Split", ["local", "ranks"], [f"local_{i}" for i in range(len(groups))], axis=1),
    ]
    for i, group in enumerate(groups):
        clusters, _, rank, places = group.values.shape
        constants[f"values_{i}"] = group.values.transpose(1, 0, 3, 2).astype(np.float32)
        constants[f"by_cluster_{i}"] = np.array([3, clusters, rank, -1], np.int64)
        constants[f"by_place_{i}"] = np.array([3, clusters * places, -1], np.int64)
        nodes += [
            helper.make_node("Reshape", [f"local_{i}", f"by_cluster_{i}"], [f"amounts_{i}"]),
            helper.make_node("MatMul", [f"values_{i}", f"amounts_{i}"], [f"mixed_{i}"]),
            helper.make_node("Reshape", [f"mixed_{i}", f"by_place_{i}"], [f"places_{i}"]),
        ]
    places = np.concatenate([group.pixels.ravel() for group in groups])
    # Pixels of no cluster take what stands behind all places.
    place_of_pixel = np.full(subject.matte.size, len(places), np.int64)
    place_of_pixel[places] = np.arange(len(places))
    constants |= {
        "ranks": np.array([group.values.shape[0] * group.values.shape[2] for group in groups], np.int64),
        "one_more_place": np.array([0, 0, 0, 0, 1, 0], np.int64),
        "place_of_pixel": place_of_pixel,
    }
    nodes += [
        helper.make_node("Concat", [f"places_{i}" for i in range(len(groups))], ["found"], axis=1),
        helper.make_node("Pad", ["found", "one_more_place"], ["places"]),
        helper.make_node("Gather", ["places", "place_of_pixel"], ["pictures"], axis=1),
    ]
    return _serialized(nodes, constants, subject.matte.size)


def _serialized(nodes: list[NodeProto], constants: dict[str, NDArray], pixels: int) -> bytes:
    from onnx import TensorProto, helper, numpy_helper

    graph = helper.make_graph(
        nodes,
        "relight",
        [helper.make_tensor_value_info("light", TensorProto.FLOAT, [3, TEXELS, "count"])],
        [helper.make_tensor_value_info("pictures", TensorProto.FLOAT, [3, pixels, "count"])],
        [numpy_helper.from_array(np.ascontiguousarray(value), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    serialized: bytes = model.SerializeToString()
    return serialized


class OnnxBasisRelighter:
    """Relights one subject with ONNX Runtime: in each group of clusters of equal rank one product.

    Attributes:
        session: the open graph.
    """

    name = "onnx-basis"

    def __init__(self, subject: Subject, options: RelighterOptions | None = None) -> None:
        """Make the subject's graph and open it as `options.session` says.

        Raises:
            DeviceError: a strict provider cannot run it.
        """
        options = options or RelighterOptions()
        self.session = open_session(partial(basis_graph, subject), "relight-basis", options.session)
        self._shape = (subject.metadata.height, subject.metadata.width)

    @property
    def provider(self) -> str:
        """The execution provider that is proven to run the graph."""
        return self.session.provider

    def relight(self, light_maps: NDArray[np.float32]) -> NDArray[np.float32]:
        """See `Relighter.relight`."""
        light = np.ascontiguousarray(weighted_light(light_maps).transpose(2, 1, 0))
        pictures = self.session.run({"light": light})["pictures"]
        return np.ascontiguousarray(pictures.transpose(2, 1, 0)).reshape(len(light_maps), *self._shape, 3)
