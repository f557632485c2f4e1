"""Relit Camera: a virtual webcam that shows its owner lit by any place they choose."""

import os
from importlib.metadata import version

# OpenCV reads it when it is loaded: whatever a header says, no decoder takes memory for more than `space.picture_files`
# lets through.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "64000000")

__version__ = version("relit-camera")
