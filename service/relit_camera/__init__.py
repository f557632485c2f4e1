"""Relit Camera: a virtual webcam that shows its owner lit by any place they choose."""

import os
from importlib.metadata import version

# OpenCV reads it when it is loaded: whatever a header says, no decoder takes memory for more than
# `base.images.image_limits` lets through.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "64000000")

__version__ = version("relit-camera")

# ONNX Runtime's wheels count uses, keep a device's number in the user's cache, and would send it to their makers. It
# looks at this when it is loaded, so it stands before every import.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"
