"""Sinks, where finished pictures go: virtual camera, video file, nothing."""
