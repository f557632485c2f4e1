"""Directions, rotations, colour curves and image types: the only place that knows axes, colour order and gamma.

Axes are right-handed: X right in the picture, Y up, Z toward the camera.
"""
