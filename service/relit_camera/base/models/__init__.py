"""Neural networks: opening them in ONNX Runtime, and the public models that users download by name.

`session_with_fallback` opens every network and proves its provider, `model_store` owns the folder of downloaded models,
`model_manifest` lists them, `tflite` converts the published TFLite files to ONNX on the user's machine.
"""
