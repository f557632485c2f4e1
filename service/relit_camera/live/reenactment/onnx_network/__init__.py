"""A reenactment network in ONNX format: its contract, its inputs and its outputs."""
