"""Webcams, video files and virtual cameras: what frames come from, and where they go."""
