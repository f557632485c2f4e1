"""Description of the machine that benchmarks run on."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
import psutil

from relit_camera import __version__


def machine_info() -> dict[str, object]:
    """Processor, cores, memory, load and the versions that matter."""
    return {
        "processor": _processor_name(),
        "cores": os.cpu_count(),
        "memory_gb": round(psutil.virtual_memory().total / 1e9, 1),
        "load_before": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "system": platform.platform(),
        "python": platform.python_version(),
        # Of the modules, not of the packages: with a GPU onnxruntime comes from onnxruntime-gpu.
        "numpy": np.__version__,
        "opencv": cv2.__version__,
        "onnxruntime": onnxruntime.__version__,
        "relit-camera": __version__,
    }


def _processor_name() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
