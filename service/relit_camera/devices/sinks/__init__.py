"""Sinks, which take the finished pictures: the virtual camera, a video file, or none."""
