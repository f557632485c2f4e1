"""Evaluation of reflectance fields: held-out lights, interpolation methods, maps."""
