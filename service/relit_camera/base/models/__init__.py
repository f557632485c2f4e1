"""Neural networks: the store of public models, and the one place that opens networks with ONNX Runtime."""
