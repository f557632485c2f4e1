"""Helpers for ONNX Runtime: options, shapes and types of a model, placement of its nodes, exceptions."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.models import provider_names

if TYPE_CHECKING:
    import onnxruntime

_ELEMENTS = {"float": "float32", "double": "float64"}
"""Where ONNX's element names differ from NumPy's."""


class TensorSpec(NamedTuple):
    """An input or output. A dimension that is not fixed is None."""

    shape: tuple[int | None, ...]
    dtype: np.dtype

    def __str__(self) -> str:
        return f"{self.dtype.name} [{', '.join('?' if size is None else str(size) for size in self.shape)}]"


def runtime_options(threads: int, constants: Mapping[str, NDArray] | None = None) -> onnxruntime.SessionOptions:
    """Options for `threads` threads on one operator and one operator at a time, none of them spinning.

    `constants` are the external tensors of the model by name.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    # Its own arenas would keep what each network needs at most, beside what all the others keep: 25 MB more, no faster.
    options.enable_cpu_mem_arena = options.enable_mem_pattern = False
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    options.add_session_config_entry("session.record_ep_graph_assignment_info", "1")
    if constants:
        values = [onnxruntime.OrtValue.ortvalue_from_numpy(value) for value in constants.values()]
        options.add_external_initializers(list(constants), values)
    return options


def tensor_specs(arguments: list[onnxruntime.NodeArg]) -> dict[str, TensorSpec]:
    """Read the shapes and dtypes of a model's inputs or outputs by name.

    Raises:
        ValueError: one of them is no tensor of numbers.
    """
    specs = {}
    for argument in arguments:
        element = re.fullmatch(r"tensor\((\w+)\)", argument.type)
        try:
            dtype = np.dtype(_ELEMENTS.get(element[1], element[1]) if element else argument.type)
        except TypeError:
            raise ValueError(f"{argument.name} is a {argument.type}, not a tensor of numbers") from None
        specs[argument.name] = TensorSpec(tuple(d if isinstance(d, int) else None for d in argument.shape), dtype)
    return specs


def warm_up(runtime: onnxruntime.InferenceSession, inputs: Mapping[str, TensorSpec]) -> float | None:
    """Run twice on zeros (the first run allocates); returns the second's milliseconds.

    A model with an open dimension other than its first cannot be fed without knowing it: None.
    """
    if any(None in spec.shape[1:] for spec in inputs.values()):
        return None
    zeros = {name: np.zeros([1 if size is None else size for size in spec.shape], spec.dtype)
             for name, spec in inputs.items()}  # fmt: skip
    runtime.run(None, zeros)
    start = time.perf_counter()
    runtime.run(None, zeros)
    return (time.perf_counter() - start) * 1e3


def node_placement(runtime: onnxruntime.InferenceSession) -> dict[str, int]:
    """Count the graph's nodes on each provider, as ONNX Runtime has really placed them."""
    placement: Counter[str] = Counter()
    for subgraph in runtime.get_provider_graph_assignment_info():
        placement[provider_names.short_name(subgraph.ep_name)] += len(subgraph.get_nodes())
    return dict(placement)


@cache
def runtime_errors() -> tuple[type[Exception], ...]:
    """List what ONNX Runtime raises: its own exceptions have no base class in common."""
    from onnxruntime.capi import onnxruntime_pybind11_state as state

    own = [kind for kind in vars(state).values() if isinstance(kind, type) and issubclass(kind, Exception)]
    return (ValueError, RuntimeError, *own)


def reason(error: Exception) -> str:
    """Shorten ONNX Runtime's message to its first line, without the code in front."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return re.sub(r"^\[ONNXRuntimeError\] : \d+ : \w+ : ", "", lines[0])
