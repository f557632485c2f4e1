"""Converter from TensorFlow Lite to ONNX for the public face and matting networks."""
