"""Pictures: types and checks, files and their limits, color conversion, tone mapping, resizing, quality measures.

The only package that knows channel orders and transfer curves: everything else sees linear or sRGB RGB.
"""
