"""Compression of a reflectance field: accuracy target, tiles, components, local bases, and packing as WebP."""
