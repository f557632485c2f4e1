"""Field × light → picture (thesis 6.1, 6.2): dense reference, basis, ONNX graph."""
