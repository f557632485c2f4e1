"""Neural networks: the one place that opens them, and the public ones that are pulled by name.

`session` is the only user of ONNX Runtime, `registry` the only owner of the folder of pulled models, `tflite` the
converter that turns the upstream files into ONNX on the user's machine.
"""
