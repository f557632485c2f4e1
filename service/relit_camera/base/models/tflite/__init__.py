"""A converter from TensorFlow Lite to ONNX for the public face and matting networks.

`reader` parses the flatbuffer, `graph` collects ONNX nodes and keeps track of layouts, `operators` is the table from
TFLite's operators to ONNX's, `convert` puts them together.
"""
