"""Relit Camera: a virtual webcam that shows its owner lit by any place they choose."""

from importlib.metadata import version

__version__ = version("relit-camera")
