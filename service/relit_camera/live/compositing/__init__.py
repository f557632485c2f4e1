"""Compositing: matting, backgrounds, and the person over the background with the display curve applied."""
