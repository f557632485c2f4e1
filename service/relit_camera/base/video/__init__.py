"""Video files through FFmpeg (PyAV): reading as uint8 sRGB or as linear light, and writing H.264."""
