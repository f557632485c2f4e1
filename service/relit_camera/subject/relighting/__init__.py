"""Relighting: reflectance field × light map → picture (thesis 6.1, 6.2), dense, in bases, or as an ONNX graph."""
