"""Captures beside the running camera, of its webcam, before a screen or from a film; a worker makes the subject."""
