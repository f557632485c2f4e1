"""Compression of a reflectance field to a basis and coefficients."""
