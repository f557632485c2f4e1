"""Samples → reflectance field: triangulation and interpolation over directions; one file a method."""
