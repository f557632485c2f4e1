"""Image types, files, colour and display curves, resizing: the only place that knows colour order and gamma.

Pictures are float32 or uint8 arrays (height, width, 3), RGB.
"""
