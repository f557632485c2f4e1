"""Relighting one picture by every implementation, in one run (thesis, Table 6.1), and their agreement."""

from __future__ import annotations

import os
from collections.abc import Mapping

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from relit_camera.bench.timing import median_ms
from relit_camera.light.maps import LightMap
from relit_camera.models.session import SessionOptions
from relit_camera.relight.basis import BasisRelighter
from relit_camera.relight.dense import DenseRelighter
from relit_camera.relight.onnx_graph import OnnxBasisRelighter
from relit_camera.relight.relighter import weighted_light
from relit_camera.space.quality import psnr
from relit_camera.subject.subject import Subject

NAIVE_PIXELS = 600
"""The naive loop is timed on so many pixels and scaled up."""


def bench_relighting(subject: Subject, maps: Mapping[str, LightMap], options: SessionOptions) -> dict[str, object]:
    """Milliseconds a picture of each implementation, memory, and the basis against the dense matrix under each map.

    All hold float32, have every core, and give the finished (height, width, 3) picture. `naive_ms` loops over pixels
    and multiplies map by map, as Eq. 6.1 is written; `gemm_ms` is OpenCV's product, the thesis's CPU implementation.
    """
    with threadpool_limits(limits=os.cpu_count(), user_api="blas"):
        return _measure(subject, maps, options)


def _measure(subject: Subject, maps: Mapping[str, LightMap], options: SessionOptions) -> dict[str, object]:
    light_map = next(iter(maps.values()))
    dense, basis = DenseRelighter(subject), BasisRelighter(subject)
    matrix = dense.matrix
    shape = (subject.metadata.height, subject.metadata.width)
    light = weighted_light(light_map)

    def gemm() -> np.ndarray:
        planes = [cv2.gemm(matrix[c], light[:, c : c + 1], 1, None, 0) for c in range(3)]
        return np.asarray(cv2.merge([plane.reshape(shape) for plane in planes]))

    def naive() -> None:
        for pixel in range(NAIVE_PIXELS):
            for c in range(3):
                (matrix[c, pixel] * light[:, c]).sum()

    result: dict[str, object] = {
        "size": [subject.metadata.width, subject.metadata.height],
        "lights": subject.metadata.lights,
        "components": subject.metadata.components,
        "naive_ms": median_ms(naive, 5) * matrix.shape[1] / NAIVE_PIXELS,
        "gemm_ms": median_ms(gemm, 10),
    }
    result["numpy_ms"] = median_ms(lambda: dense.relight(light_map), 20)
    result["basis_ms"] = median_ms(lambda: basis.relight(light_map), 200)
    onnx = OnnxBasisRelighter(subject, options)
    result["onnx_ms"] = median_ms(lambda: onnx.relight(light_map), 200)
    result["onnx_provider"] = onnx.session.provider
    result["dense_mb"] = round(matrix.nbytes / 1e6, 1)
    result["basis_mb"] = round(basis.nbytes / 1e6, 1)
    result["gemm_over_basis"] = result["gemm_ms"] / result["basis_ms"]  # type: ignore[operator]
    result["numpy_over_basis"] = result["numpy_ms"] / result["basis_ms"]  # type: ignore[operator]
    result["psnr_db"] = {
        name: psnr(basis.relight(each), dense.relight(each), subject.matte) for name, each in maps.items()
    }
    return result
