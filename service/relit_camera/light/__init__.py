"""Light: panoramas, environments, light maps, lamps and exposure.

A light map is float32 (32, 64, 3), linear RGB radiance in the axes of `light.directions`; a panorama is the same light
at the resolution of its file. The energy Σ E·ω is preserved: exactly by resampling, within 1 % for any lamp by
rotation.
"""
