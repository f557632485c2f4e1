"""Benchmarks of relighting: every implementation in one run (thesis, Table 6.1), and GPU transfers (Table 6.2)."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from relit_camera.base.images.image_quality import psnr
from relit_camera.base.models.session_with_fallback import SessionOptions, open_session
from relit_camera.light.light_map import LightMap
from relit_camera.subject.relighting.basis_relighter import BasisRelighter
from relit_camera.subject.relighting.dense_relighter import DenseRelighter
from relit_camera.subject.relighting.onnx_relighter import OnnxBasisRelighter
from relit_camera.subject.relighting.relighter import RelighterOptions, weighted_light
from relit_camera.subject.subject import Subject


def median_ms(call: Callable[[], object], repeats: int = 30, at_most_s: float = 5.0) -> float:
    """Median milliseconds of a call after two that are not counted; fewer repeats if they would last too long."""
    call()
    started = time.perf_counter()
    call()
    once = time.perf_counter() - started
    durations = []
    for _ in range(max(3, min(repeats, int(at_most_s / max(once, 1e-9))))):
        started = time.perf_counter()
        call()
        durations.append(time.perf_counter() - started)
    return float(np.median(durations) * 1e3)


NAIVE_LOOP_PIXELS = 600
"""Number of pixels that the naive loop is timed on; the time is scaled up to the picture."""


def benchmark_relighting(subject: Subject, maps: Mapping[str, LightMap], options: SessionOptions) -> dict[str, object]:
    """Milliseconds a picture of each implementation, memory, and the basis against the dense matrix under each map.

    All have every core and give the finished (height, width, 3) picture; the basis holds 8-bit integers, the others
    float32. `naive_ms` loops over pixels and multiplies map by map, as Eq. 6.1 is written; `gemm_ms` is OpenCV's
    product, the thesis's CPU implementation. `gb_per_s` says how fast memory is read: by the basis, by numpy's dense
    product, and at most (`read`, the largest of the dense matrix's numbers, on one core).
    """
    with threadpool_limits(limits=os.cpu_count(), user_api="blas"):
        return _benchmark_relighting(subject, maps, options)


def _benchmark_relighting(subject: Subject, maps: Mapping[str, LightMap], options: SessionOptions) -> dict[str, object]:
    light_map = next(iter(maps.values()))
    every_core = replace(options, threads=os.cpu_count() or 1)
    dense, basis = DenseRelighter(subject), BasisRelighter(subject, RelighterOptions(every_core))
    matrix = dense.matrix
    shape = (subject.metadata.height, subject.metadata.width)
    light = weighted_light(light_map)

    def gemm() -> np.ndarray:
        planes = [cv2.gemm(matrix[c], light[:, c : c + 1], 1, None, 0) for c in range(3)]
        return np.asarray(cv2.merge([plane.reshape(shape) for plane in planes]))

    def naive() -> None:
        for pixel in range(NAIVE_LOOP_PIXELS):
            for c in range(3):
                (matrix[c, pixel] * light[:, c]).sum()

    result: dict[str, object] = {
        "size": [subject.metadata.width, subject.metadata.height],
        "lights": subject.metadata.lights,
        "components": subject.metadata.components,
        "naive_ms": median_ms(naive, 5) * matrix.shape[1] / NAIVE_LOOP_PIXELS,
        "gemm_ms": median_ms(gemm, 10),
    }
    result["numpy_ms"] = median_ms(lambda: dense.relight(light_map[None]), 20)
    result["basis_ms"] = median_ms(lambda: basis.relight(light_map[None]), 200)
    onnx = OnnxBasisRelighter(subject, RelighterOptions(every_core))
    result["onnx_ms"] = median_ms(lambda: onnx.relight(light_map[None]), 200)
    result["onnx_provider"] = onnx.session.provider
    result["dense_mb"] = round(matrix.nbytes / 1e6, 1)
    result["basis_mb"] = round(basis.nbytes / 1e6, 1)
    read_ms = median_ms(matrix.max, 5)
    result["gb_per_s"] = {
        "basis": basis.nbytes / 1e6 / result["basis_ms"],  # type: ignore[operator]
        "dense": matrix.nbytes / 1e6 / result["numpy_ms"],  # type: ignore[operator]
        "read": matrix.nbytes / 1e6 / read_ms,
    }
    result["gemm_over_basis"] = result["gemm_ms"] / result["basis_ms"]  # type: ignore[operator]
    result["numpy_over_basis"] = result["numpy_ms"] / result["basis_ms"]  # type: ignore[operator]
    every_map = np.stack(list(maps.values()))
    result["psnr_db"] = {
        name: psnr(seen, truth, subject.matte)
        for name, seen, truth in zip(maps, basis.relight(every_map), dense.relight(every_map), strict=True)
    }
    return result


MATRIX_SIZE = 1000
PRODUCT_COUNT = 100


def benchmark_gpu_transfer(options: SessionOptions) -> dict[str, object] | None:
    """Milliseconds for 100 products of 1000 x 1000 float32: numpy, a factor sent each time, a factor kept.

    None where no GPU provider is really used.
    """
    from onnx import TensorProto, helper, numpy_helper

    rng = np.random.default_rng(0)
    a, b = (rng.random((MATRIX_SIZE, MATRIX_SIZE), dtype=np.float32) for _ in range(2))
    kept_value = numpy_helper.from_array(a, "a")
    port = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [MATRIX_SIZE, MATRIX_SIZE]) for name in ("a", "b", "c")
    ]
    node = helper.make_node("MatMul", ["a", "b"], ["c"])
    opset = [helper.make_opsetid("", 17)]
    graphs = {
        "sent_ms": helper.make_graph([node], "sent", port[:2], [port[2]]),
        "kept_ms": helper.make_graph([node], "kept", [port[1]], [port[2]], [kept_value]),
    }
    result: dict[str, object] = {}
    for name, graph in graphs.items():
        model = helper.make_model(graph, opset_imports=opset, ir_version=9).SerializeToString()
        session = open_session(model, f"bench-{name}", options)
        if session.provider == "cpu":
            return None
        feed = {"a": a, "b": b} if name == "sent_ms" else {"b": b}
        result[name] = median_ms(partial(session.run, feed)) * PRODUCT_COUNT
        result["provider"] = session.provider
    result["numpy_ms"] = median_ms(lambda: a @ b, 10) * PRODUCT_COUNT
    return result
