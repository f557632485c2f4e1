"""Video files: reading (as uint8 sRGB for people, as linear light for measuring) and writing, through FFmpeg (PyAV)."""
